#include "pipeline/tradeoff/loss.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::FloatEq;
using ::testing::IsNan;

/// A source of `source` pixels, stretched to the volume.
Placement stretched(ImageSize source, ImageSize volume) { return {source, volume, volume, 0, 0}; }

TEST(OnGrid, GivesEachPixelTheMeanByAreaByAxisAndChannel) {
  // Two pixels to three: a new one is 2/3 of an old one wide, the middle one lies half on each.
  const Placement two = stretched({1, 6}, {1, 2});
  const Placement three = stretched({1, 6}, {1, 3});
  EXPECT_THAT(on_grid({3, 6}, 1, two, three), ElementsAre(FloatEq(3), FloatEq(4.5), FloatEq(6)));
  // Three to two: a new one covers one and a half.
  EXPECT_THAT(on_grid({3, 6, 9}, 1, three, two), ElementsAre(FloatEq(4), FloatEq(8)));
  const Placement small = stretched({4, 4}, {1, 2});
  const Placement large = stretched({4, 4}, {2, 4});
  EXPECT_THAT(on_grid({1, 2, 3, 4}, 2, small, large),
              ElementsAreArray({1, 1, 2, 2, 1, 1, 2, 2, 3, 3, 4, 4, 3, 3, 4, 4}));
}

TEST(OnGrid, KeepsTheEventsPerPixelOfTheWholeImage) {
  const Placement from = stretched({70, 90}, {35, 45});
  const Placement to = stretched({70, 90}, {47, 61});
  std::vector<float> values(from.volume.pixel_count());
  std::iota(values.begin(), values.end(), 0.0f);
  const std::vector<float> mapped = on_grid(values, 1, from, to);
  const auto mean = [](const std::vector<float>& of) {
    return std::accumulate(of.begin(), of.end(), 0.0) / static_cast<double>(of.size());
  };
  EXPECT_NEAR(mean(mapped), mean(values), 1e-3);
}

TEST(OnGrid, FollowsTheImageThroughItsOffsets) {
  // A source of four columns at half its size behind a border of one, and whole but for a column
  // cut off on either side: columns 1 and 2 of the source, halves of the small image's pixels.
  const Placement letterbox{{1, 4}, {1, 2}, {1, 4}, 1, 0};
  const Placement crop{{1, 4}, {1, 4}, {1, 2}, -1, 0};
  EXPECT_THAT(on_grid({9, 5, 7, 9}, 1, letterbox, crop), ElementsAre(FloatEq(5), FloatEq(7)));
  // Back: of each letterboxed pixel, two columns of the source, the crop has one; the other is 0.
  EXPECT_THAT(on_grid({6, 8}, 1, crop, letterbox),
              ElementsAre(FloatEq(0), FloatEq(3), FloatEq(4), FloatEq(0)));
}

TEST(OnGrid, OfTheSamePlacementChangesNothingAndRefusesOthersImages) {
  const Placement same = stretched({5, 5}, {1, 2});
  EXPECT_THAT(on_grid({0.1f, 0.2f}, 1, same, same), ElementsAre(0.1f, 0.2f));
  EXPECT_THROWS(on_grid({1, 2, 3}, 1, same, same), std::invalid_argument,
                "expected 1 channels of 2 pixels of one source image, got 3");
  EXPECT_THROWS(on_grid({1, 2}, 1, same, stretched({5, 6}, {1, 2})), std::invalid_argument,
                "expected 1 channels of 2 pixels of one source image, got 2");
}

TEST(LabelledPixels, AreThoseOfBoxesWhoseCentreLiesInside) {
  VolumeLabels labels;
  labels.boxes.push_back({{0.6, 0, 3.5, 1}, {}, false, {}});  // the centres at 1.5, 2.5 and 3.5
  labels.boxes.push_back({{0, 1, 5, 2}, {}, /*ignore=*/true, {}});
  EXPECT_THAT(labelled_pixels(labels, {2, 5}), ElementsAre(0, 1, 1, 1, 0, 0, 0, 0, 0, 0));
}

TEST(LabelledPixels, AreThoseOfPersonsCrops) {
  VolumePerson person;
  person.center = {9, 14};
  person.scale = 0.02;  // 221 x 0.02 = 4.42 px to each side of (9, 14.3)
  VolumeLabels labels;
  labels.persons.resize(2);
  labels.persons[0] = person;  // nothing is known of the other
  const std::vector<std::uint8_t> pixels = labelled_pixels(labels, {18, 12});
  for (int y = 0; y < 18; ++y) {
    for (int x = 0; x < 12; ++x) {
      const bool inside = x >= 5 && y >= 10;  // to column 13 and row 18, of which there are fewer
      EXPECT_EQ(pixels[static_cast<std::size_t>(y * 12 + x)], inside ? 1 : 0) << x << ", " << y;
    }
  }
}

TEST(LabelledPixels, OfACropThatReachesFarBeyondTheVolumeAreAll) {
  VolumePerson person;
  person.center = {3, 3};
  person.scale = 1e300;
  VolumeLabels labels;
  labels.persons.push_back(person);
  EXPECT_THAT(labelled_pixels(labels, {5, 7}), Each(1));
}

TEST(PairLoss, IsDerivedByHand) {
  // Two bins, one row of two pixels; channels: positive 0, 1, negative 0, 1.
  const VolumeShape shape{2, {1, 2}};
  const std::vector<float> reference{0.6f, 0, 0, 0.8f, 0, 0, 0, 0};
  const std::vector<float> volume{0.6f, 0, 0, 0, 0, 0, 0, 0.8f};
  const std::vector<std::uint8_t> everywhere{1, 1};
  const PairLoss loss = pair_loss(volume, reference, shape, everywhere);
  // ‖R‖² = 0.36 + 0.64 = 1, ‖V - R‖² = 2 · 0.64.
  EXPECT_NEAR(loss.relative_l2, std::sqrt(1.28), 1e-6);
  EXPECT_FLOAT_EQ(static_cast<float>(loss.largest), 0.8f);
  EXPECT_DOUBLE_EQ(loss.f1_raw, 2.0 / 4);  // two events each, one in common
  EXPECT_DOUBLE_EQ(loss.f1_time, 2.0 / 4);
  EXPECT_EQ(loss.labelled_events, 2);
  EXPECT_EQ(loss.lost_events, 1);  // that of the right pixel, which has another sign now
  const PairLoss left = pair_loss(volume, reference, shape, std::vector<std::uint8_t>{1, 0});
  EXPECT_EQ(left.labelled_events, 1);
  EXPECT_EQ(left.lost_events, 0);
  const PairLoss none = pair_loss(reference, reference, shape, everywhere);
  EXPECT_EQ(none.relative_l2, 0);
  EXPECT_EQ(none.largest, 0);
  EXPECT_NEAR(none.time_correlation, 1, 1e-9);
  EXPECT_EQ(none.lost_events, 0);
}

TEST(OverallLoss, IsTheMedianErrorTheLargestTheMeanScoresAndTheSums) {
  const double no_meaning = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  const PairLoss loss = overall_loss(std::vector<PairLoss>{{0.1, 0.5, 1, 0.8, 0.5, 10, 1},
                                                           {0.3, 0.9, 0.5, 0.6, no_meaning, 0, 0},
                                                           {infinite, 0.2, 0, 0.1, 0.7, 30, 9}});
  EXPECT_EQ(loss.relative_l2, 0.3);
  EXPECT_EQ(loss.largest, 0.9);
  EXPECT_DOUBLE_EQ(loss.f1_raw, 0.5);
  EXPECT_DOUBLE_EQ(loss.f1_time, 0.5);
  EXPECT_DOUBLE_EQ(loss.time_correlation, 0.6);  // of the two that have one
  EXPECT_DOUBLE_EQ(lost_share(loss), 0.25);
  EXPECT_THAT(lost_share({}), IsNan());
  EXPECT_THAT(overall_loss({}).relative_l2, IsNan());
}

TEST(SpreadOf, IsMedianAndQuartilesByRank) {
  const Spread odd = spread_of({5, 1, 3});
  EXPECT_EQ(odd.median, 3);
  EXPECT_EQ(odd.low, 2);
  EXPECT_EQ(odd.high, 4);
  EXPECT_EQ(spread_of({4, 1}).median, 2.5);
  EXPECT_EQ(spread_of({7}).high, 7);
  EXPECT_THAT(spread_of({}).median, IsNan());
}

}  // namespace
}  // namespace eventgan
