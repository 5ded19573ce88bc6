#include "stages/generator/wanted_tiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

constexpr ImageSize kSize{32, 48};  // 2 x 3 tiles of 16

std::vector<float> still_frames(ImageSize size = kSize) {
  return std::vector<float>(2 * size.pixel_count(), 0.25f);
}

/// Two frames that differ by so many grey levels in one pixel.
std::vector<float> one_pixel(int y, int x, double grey_levels, ImageSize size = kSize) {
  std::vector<float> frames = still_frames(size);
  frames[size.pixel_count() + static_cast<std::size_t>(y) * size.width + x] +=
      static_cast<float>(grey_levels / 127.5);
  return frames;
}

ScopeSpec scope_of(Scope scope) {
  ScopeSpec spec;
  spec.scope = scope;
  return spec;
}

std::vector<std::uint8_t> moving(const std::vector<float>& frames) {
  return wanted_tiles(scope_of(Scope::kMotion), frames, kSize, 0, 0, {}).wanted;
}

TEST(WantedTiles, OfAStillPairAreNone) { EXPECT_THAT(moving(still_frames()), Each(0)); }

TEST(WantedTiles, AreThoseThatAPixelThatMovesIsInOrNear) {
  EXPECT_THAT(moving(one_pixel(8, 8, 8.01)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 8, -8.01)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 8, 7.99)), Each(0));
  // 4 px around: column 12 reaches to 16, column 11 to 15.
  EXPECT_THAT(moving(one_pixel(8, 12, 9)), ElementsAre(1, 1, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 11, 9)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(19, 28, 9)), ElementsAre(0, 1, 1, 0, 1, 1));
}

TEST(WantedTiles, HoldPixelsThatAreNoNumber) {
  std::vector<float> frames = still_frames();
  frames[8 * 48 + 40] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(moving(frames), ElementsAre(0, 0, 1, 0, 0, 0));
}

TEST(WantedTiles, LieOnTheVolumesGrid) {
  // The content stands at row 10, column 20 of the volume: its first tiles begin 10 and 4 before
  // it.
  const ImageSize content{32, 40};
  const TileMask mask =
      wanted_tiles(scope_of(Scope::kMotion), one_pixel(20, 5, 20, content), content, 10, 20, {});
  EXPECT_EQ(mask.rows(), 3);
  EXPECT_EQ(mask.columns(), 3);
  // Row 20 is the volume's 30, which reaches from 26 to 34; column 5 its 25, 21 to 29.
  EXPECT_THAT(mask.wanted, ElementsAre(0, 0, 0, 1, 0, 0, 1, 0, 0));
  EXPECT_THAT(tiles_of_volume(mask, 10, 20, {64, 64}),
              ElementsAre(0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0));
}

VolumeLabels box_labels(Rectangle box, bool ignore = false) {
  VolumeLabels labels;
  labels.boxes.push_back({box, box, ignore});
  return labels;
}

TEST(WantedTiles, AreAroundLabels) {
  ScopeSpec scope = scope_of(Scope::kLabelsOnly);
  scope.label_margin_px = 2;
  const auto wanted = [&](const VolumeLabels& labels) {
    return wanted_tiles(scope, one_pixel(8, 8, 99), kSize, 0, 0, labels).wanted;
  };
  EXPECT_THAT(wanted({}), Each(0));
  EXPECT_THAT(wanted(box_labels({20, 20, 28, 28})), ElementsAre(0, 0, 0, 0, 1, 0));
  EXPECT_THAT(wanted(box_labels({20, 17, 31, 28})), ElementsAre(0, 1, 1, 0, 1, 1));
  EXPECT_THAT(wanted(box_labels({20, 20, 28, 28}, /*ignore=*/true)), Each(0));
  EXPECT_THAT(wanted(box_labels({-1e9, -1e9, 1e9, 1e9})), Each(1));

  VolumeLabels person;
  person.persons.resize(1);
  person.persons[0].joints = {kMissingPoint, {40, 4}, {44, 6}};
  EXPECT_THAT(wanted(person), ElementsAre(0, 0, 1, 0, 0, 0));
  // 1.25 x 200 x 0.04 = 10 px wide.
  person.persons[0].center = {24, 24};
  person.persons[0].scale = 0.04;
  EXPECT_THAT(wanted(person), ElementsAre(0, 0, 0, 0, 1, 0));
  person.persons[0] = {};
  person.persons[0].joints = {kMissingPoint};
  EXPECT_THAT(wanted(person), Each(0));

  scope.scope = Scope::kLabels;
  EXPECT_THAT(wanted(box_labels({20, 20, 28, 28})), ElementsAre(1, 0, 0, 0, 1, 0));
}

}  // namespace
}  // namespace eventgan
