#include "stages/generator/wanted_tiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

constexpr ImageSize kTiledSize{32, 48};  // 2 x 3 tiles of 16

std::vector<float> still_frames(ImageSize size = kTiledSize) {
  return std::vector<float>(2 * size.pixel_count(), 0.25f);
}

/// Two frames that differ by so many grey levels in one pixel.
std::vector<float> one_pixel(int y, int x, double grey_levels, ImageSize size = kTiledSize) {
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
  return wanted_tiles(scope_of(Scope::kMotion), frames, kTiledSize, 0, 0, {}).wanted;
}

TEST(WantedTiles, AreThoseThatAPixelThatMovesIsInOrNear) {
  EXPECT_THAT(moving(still_frames()), Each(0));
  // A pixel alone keeps 4/16 of its difference, and gives its neighbours 2/16.
  EXPECT_THAT(moving(one_pixel(8, 8, 24.04)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 8, -24.04)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 8, 23.96)), Each(0));
  // 4 px around: column 12 reaches to 16, column 11 to 15 and, where its neighbour moves, to 16.
  EXPECT_THAT(moving(one_pixel(8, 12, 27)), ElementsAre(1, 1, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 11, 27)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(8, 11, 49)), ElementsAre(1, 1, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(19, 28, 27)), ElementsAre(0, 1, 1, 0, 1, 1));
  // The border is repeated: a corner keeps 9/16.
  EXPECT_THAT(moving(one_pixel(0, 0, 10.7)), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(moving(one_pixel(31, 47, 10.7)), ElementsAre(0, 0, 0, 0, 0, 1));
  EXPECT_THAT(moving(one_pixel(0, 0, 10.6)), Each(0));
  std::vector<float> frames = still_frames();
  frames[8 * 48 + 40] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(moving(frames), ElementsAre(0, 0, 1, 0, 0, 0));
}

/// Of a camera at rest noise changes pixels of each tile by more than an object's edge asks for.
TEST(WantedTiles, AreNotThoseOfNoise) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 2 / 127.5f);
  std::vector<float> frames = still_frames();
  for (float& value : frames) value += noise(random);
  const std::size_t pixels = kTiledSize.pixel_count();
  int differing = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    differing += std::abs(frames[pixels + i] - frames[i]) > 6 / 127.5f ? 1 : 0;
  }
  EXPECT_GT(differing, 6 * 4) << "of 6 tiles";
  // The difference has a standard deviation of 2 sqrt(2), smoothed 3/8 of it: 6 are 5.7 of these.
  EXPECT_THAT(moving(frames), Each(0));
  for (int y = 4; y < 10; ++y) frames[pixels + static_cast<std::size_t>(y) * 48 + 40] += 0.4f;
  EXPECT_THAT(moving(frames), ElementsAre(0, 0, 1, 0, 0, 0)) << "an edge of 51 grey levels";
}

TEST(WantedTiles, AreAllOfAnImageOfOnePixelThatMoves) {
  constexpr ImageSize kOne{1, 1};
  EXPECT_THAT(
      wanted_tiles(scope_of(Scope::kMotion), one_pixel(0, 0, 6.1, kOne), kOne, 0, 0, {}).wanted,
      ElementsAre(1));
  EXPECT_THAT(
      wanted_tiles(scope_of(Scope::kMotion), one_pixel(0, 0, 5.9, kOne), kOne, 0, 0, {}).wanted,
      ElementsAre(0));
}

TEST(WantedTiles, LieOnTheVolumesGrid) {
  // The content is at row 10, column 20 of the volume: its first tiles begin 10 and 4 before
  // it.
  const ImageSize content{32, 40};
  const TileMask mask =
      wanted_tiles(scope_of(Scope::kMotion), one_pixel(20, 5, 40, content), content, 10, 20, {});
  EXPECT_EQ(mask.rows(), 3);
  EXPECT_EQ(mask.columns(), 3);
  // Row 20 is the volume's 30, which reaches from 26 to 34; column 5 its 25, 21 to 29.
  EXPECT_THAT(mask.wanted, ElementsAre(0, 0, 0, 1, 0, 0, 1, 0, 0));
  EXPECT_THAT(tiles_of_volume(mask, 10, 20, {64, 64}),
              ElementsAre(0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0));
}

VolumeLabels box_labels(Rectangle box, bool ignore = false) {
  VolumeLabels labels;
  labels.boxes.push_back({box, box, ignore, {}});
  return labels;
}

TEST(WantedTiles, AreAroundLabels) {
  ScopeSpec scope = scope_of(Scope::kLabelsOnly);
  scope.label_margin_px = 2;
  const auto wanted = [&](const VolumeLabels& labels) {
    return wanted_tiles(scope, one_pixel(8, 8, 99), kTiledSize, 0, 0, labels).wanted;
  };
  EXPECT_THAT(wanted({}), Each(0));
  EXPECT_THAT(wanted(box_labels({20, 20, 28, 28})), ElementsAre(0, 0, 0, 0, 1, 0));
  EXPECT_THAT(wanted(box_labels({20, 17, 31, 28})), ElementsAre(0, 1, 1, 0, 1, 1));
  EXPECT_THAT(wanted(box_labels({20, 20, 28, 28}, /*ignore=*/true)), Each(0));
  EXPECT_THAT(wanted(box_labels({-1e9, -1e9, 1e9, 1e9})), Each(1));

  VolumeLabels person;
  person.persons.resize(1);
  // Their box is 4 px wide and 2 high: the crop reaches 1.105 x 4 - 4 / 2 = 2.4 px to the left and
  // right of it and 1.105 x 4 = 4.4 px, with one of them alone, above and below it.
  person.persons[0].joints = {kMissingPoint, {39, 6}, {43, 8}};
  EXPECT_THAT(wanted(person), ElementsAre(0, 0, 1, 0, 0, 0));  // to row 13, and 2 of margin
  person.persons[0].joints = {kMissingPoint, {39, 7}, {43, 9}};
  EXPECT_THAT(wanted(person), ElementsAre(0, 0, 1, 0, 0, 1));
  // 221 x 0.02 = 4.4 px to each side of (24, 23 + 15 x 0.02), and 2 of margin.
  person.persons[0].center = {24, 23};
  person.persons[0].scale = 0.02;
  EXPECT_THAT(wanted(person), ElementsAre(0, 0, 0, 0, 1, 0));
  person.persons[0] = {};
  person.persons[0].joints = {kMissingPoint};
  EXPECT_THAT(wanted(person), Each(0));

  scope.scope = Scope::kLabels;
  EXPECT_THAT(wanted(box_labels({20, 20, 28, 28})), ElementsAre(1, 0, 0, 0, 1, 0));
}

/// What PoseDataset and Simple Baselines do, sampled: the extent of squares of any joints, as they
/// may be varied, of pixels whose corners are sampled.
TEST(PoseCrop, HoldsEverySquareThatAugmentationMakes) {
  const auto extent = [](Point center, double scale) {
    Rectangle all{center.x, center.y, center.x, center.y};
    for (const double factor : {0.75, 1.0, 1.25}) {
      for (int angle_deg = -60; angle_deg <= 60; ++angle_deg) {
        const double angle = angle_deg * std::numbers::pi / 180;
        for (const double x : {-100.0, 100.0}) {
          for (const double y : {-100.0, 100.0}) {
            const double size = scale * factor;
            const Point corner{center.x + size * (x * std::cos(angle) - y * std::sin(angle)),
                               center.y + size * (x * std::sin(angle) + y * std::cos(angle))};
            all = {std::min(all.left, corner.x), std::min(all.top, corner.y),
                   std::max(all.right, corner.x), std::max(all.bottom, corner.y)};
          }
        }
      }
    }
    return all;
  };
  const auto expect_inside = [](const Rectangle& inner, const Rectangle& outer) {
    EXPECT_GE(inner.left, outer.left - 1e-9);
    EXPECT_GE(inner.top, outer.top - 1e-9);
    EXPECT_LE(inner.right, outer.right + 1e-9);
    EXPECT_LE(inner.bottom, outer.bottom + 1e-9);
  };
  std::mt19937 random(7);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<>(low, high)(random);
  };
  for (int i = 0; i < 30; ++i) {
    VolumePerson person;
    person.center = {between(-20, 300), between(-20, 300)};
    person.scale = between(0.01, 3);
    const Rectangle mpii =
        extent({person.center.x, person.center.y + 15 * person.scale}, 1.25 * person.scale);
    const Rectangle crop = pose_crop(person);
    EXPECT_NEAR(crop.left, mpii.left, 1e-9);  // no larger than MPII's
    EXPECT_NEAR(crop.top, mpii.top, 1e-9);
    EXPECT_NEAR(crop.right, mpii.right, 1e-9);
    EXPECT_NEAR(crop.bottom, mpii.bottom, 1e-9);
    expect_inside(extent(person.center, person.scale), crop);

    person.scale = -1;
    for (int joint = 0; joint < 4; ++joint) {
      person.joints.push_back({between(0, 40), between(0, i % 2 == 0 ? 40 : 3)});
    }
    for (unsigned taken = 1; taken < 16; ++taken) {
      Rectangle box{1e9, 1e9, -1e9, -1e9};
      for (unsigned joint = 0; joint < 4; ++joint) {
        if ((taken >> joint & 1) == 0) continue;
        const Point at = person.joints[joint];
        box = {std::min(box.left, at.x), std::min(box.top, at.y), std::max(box.right, at.x),
               std::max(box.bottom, at.y)};
      }
      const double side = std::max({box.right - box.left, box.bottom - box.top, 1.0});
      expect_inside(
          extent({(box.left + box.right) / 2, (box.top + box.bottom) / 2}, 1.25 * side / 200),
          pose_crop(person));
    }
  }
}

}  // namespace
}  // namespace eventgan
