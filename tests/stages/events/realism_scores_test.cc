#include "stages/events/realism/realism_scores.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "stages/events/realism/detail/motion_direction.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::IsNan;

/// 3 bins (τ = 0, 1/2, 1), 3x3 pixels, one unit of volume a pixel at the time 0.2 x + 0.1 y,
/// shared between its two nearest bins; odd columns are negative.
std::vector<float> sloped_volume(const VolumeShape& shape) {
  std::vector<float> volume(shape.value_count(), 0.0f);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) {
      const float star = 2 * (0.2f * static_cast<float>(x) + 0.1f * static_cast<float>(y));
      const int bin = star < 1 ? 0 : 1;
      const int channel = (x % 2 == 0 ? 0 : 3) + bin;
      const float above = star - static_cast<float>(bin);
      volume[static_cast<std::size_t>(channel * 9 + y * 3 + x)] = 1 - above;
      volume[static_cast<std::size_t>((channel + 1) * 9 + y * 3 + x)] = above;
    }
  }
  return volume;
}

void erase_pixel(std::vector<float>& volume, int y, int x) {
  for (int channel = 0; channel < 6; ++channel) {
    volume[static_cast<std::size_t>(channel * 9 + y * 3 + x)] = 0;
  }
}

constexpr VolumeShape kSlopeShape{3, {3, 3}};

TEST(TimeSlope, IsOfBothPolaritiesTogether) {
  const TimeSlope slope = time_slope(sloped_volume(kSlopeShape), kSlopeShape, 0.1);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) {
      EXPECT_EQ(slope.known(y, x), 255);
      EXPECT_NEAR(slope.x(y, x), 0.2, 1e-6);
      EXPECT_NEAR(slope.y(y, x), 0.1, 1e-6);
    }
  }
}

TEST(TimeSlope, LooksOnlyAtPixelsWithEvents) {
  std::vector<float> volume = sloped_volume(kSlopeShape);
  erase_pixel(volume, 1, 0);
  erase_pixel(volume, 0, 2);
  erase_pixel(volume, 2, 2);
  const TimeSlope slope = time_slope(volume, kSlopeShape, 0.1);
  EXPECT_EQ(slope.event(1, 0), 0);
  EXPECT_EQ(slope.known(1, 0), 0);
  EXPECT_NEAR(slope.x(1, 1), 0.2, 1e-6);  // from the right neighbour alone
  EXPECT_EQ(slope.known(1, 2), 0);        // nothing above or below
  EXPECT_EQ(slope.known(0, 0), 0);        // nothing below
  EXPECT_EQ(slope.known(0, 1), 255);
}

TEST(TimeSlope, OfFaintVolumesOneBinOrOnePixelIsFlat) {
  std::vector<float> volume = sloped_volume(kSlopeShape);
  for (float& value : volume) value *= 0.05f;
  EXPECT_EQ(cv::countNonZero(time_slope(volume, kSlopeShape, 0.1).event), 0);
  const std::vector<float> empty(kSlopeShape.value_count(), 0.0f);
  EXPECT_EQ(cv::countNonZero(time_slope(empty, kSlopeShape, 0).event), 0);
  volume = std::vector<float>(2 * 6, 1.0f);
  EXPECT_EQ(cv::countNonZero(time_slope(volume, {1, {2, 3}}, 0.1).x), 0);
  const std::vector<float> pixel(6, 1.0f);
  EXPECT_EQ(cv::countNonZero(time_slope(pixel, {3, {1, 1}}, 0.1).known), 0);
}

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

GreyImage dark(ImageSize size) { return {size, std::vector<std::uint8_t>(size.pixel_count(), 0)}; }

RealismScores scores_of(const std::vector<float>& volume, const std::vector<float>& real,
                        const VolumeShape& shape) {
  return realism_scores(volume, real, shape, dark(shape.size), dark(shape.size));
}

/// A volume of zeros, to be filled by channel, row and column.
struct Voxels {
  explicit Voxels(const VolumeShape& of) : shape(of), values(of.value_count(), 0.0f) {}
  float& at(int channel, int y, int x) {
    return values[static_cast<std::size_t>((channel * shape.size.height + y) * shape.size.width +
                                           x)];
  }
  VolumeShape shape;
  std::vector<float> values;
};

TEST(RealismScores, OfTheRealVolumeItselfArePerfect) {
  Voxels real({3, {4, 6}});
  real.at(0, 0, 0) = 1;
  real.at(2, 1, 3) = 1;
  real.at(4, 3, 5) = 1;
  const RealismScores scores = scores_of(real.values, real.values, real.shape);
  EXPECT_EQ(scores.f1_raw, 1);
  EXPECT_EQ(scores.f1_time, 1);
  EXPECT_EQ(scores.f1_time_polarity, 1);
  EXPECT_EQ(scores.pool_mse_2, 0);
  EXPECT_EQ(scores.pool_mse_4, 0);
  EXPECT_NEAR(scores.time_correlation, 1, 1e-12);
}

TEST(RealismScores, EventsElsewhereMatchNothing) {
  Voxels ours({1, {2, 4}});
  Voxels real({1, {2, 4}});
  ours.at(0, 0, 0) = 1;
  real.at(0, 0, 2) = 1;
  const RealismScores scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_EQ(scores.f1_raw, 0);
  EXPECT_EQ(scores.f1_time, 0);
  EXPECT_EQ(scores.f1_time_polarity, 0);
  // Two channels of two 2x2 blocks: the differences of the means are 1/4, -1/4, 0, 0.
  EXPECT_DOUBLE_EQ(scores.pool_mse_2, 2.0 / 16 / 4);
  // A 4x4 block cut to 2x4 holds both events: no difference.
  EXPECT_EQ(scores.pool_mse_4, 0);
}

TEST(RealismScores, F1CountsHitsMissesAndFalseEvents) {
  Voxels ours({1, {1, 4}});
  Voxels real({1, {1, 4}});
  for (const int x : {0, 1, 2}) ours.at(0, 0, x) = 1;
  for (const int x : {1, 3}) real.at(0, 0, x) = 1;
  // 1 hit, 2 false, 1 missed: 2 / (2 + 2 + 1).
  EXPECT_DOUBLE_EQ(scores_of(ours.values, real.values, ours.shape).f1_raw, 0.4);
}

TEST(RealismScores, ShiftsWithinABlockAreNoDifferenceAfterPooling) {
  Voxels ours({1, {4, 4}});
  Voxels real({1, {4, 4}});
  ours.at(1, 2, 2) = 1;
  real.at(1, 3, 3) = 1;
  RealismScores scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_EQ(scores.f1_raw, 0);
  EXPECT_EQ(scores.pool_mse_2, 0);
  ours = Voxels({1, {3, 3}});
  real = Voxels({1, {3, 3}});
  ours.at(0, 2, 2) = 1;
  scores = scores_of(ours.values, real.values, ours.shape);
  // Side 2: the last block is that pixel alone, one of 2 x 4 blocks. Side 4: the mean of 9 pixels.
  EXPECT_DOUBLE_EQ(scores.pool_mse_2, 1.0 / 8);
  EXPECT_DOUBLE_EQ(scores.pool_mse_4, 1.0 / 81 / 2);
}

TEST(RealismScores, AnotherPolarityOrTimeMatchesOnceItIsSummedOver) {
  Voxels ours({2, {2, 2}});
  Voxels real({2, {2, 2}});
  ours.at(1, 0, 1) = 1;
  real.at(3, 0, 1) = 1;
  RealismScores scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_EQ(scores.f1_raw, 0);
  EXPECT_EQ(scores.f1_time, 0);
  EXPECT_EQ(scores.f1_time_polarity, 1);
  ours = Voxels({2, {2, 2}});
  real = Voxels({2, {2, 2}});
  ours.at(0, 1, 1) = 1;
  real.at(1, 1, 1) = 1;
  scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_EQ(scores.f1_raw, 0);
  EXPECT_EQ(scores.f1_time, 1);
}

TEST(RealismScores, CountWhatIsAboveOneAsOne) {
  Voxels ours({2, {2, 3}});
  Voxels real({2, {2, 3}});
  ours.at(0, 1, 1) = 7e6f;
  ours.at(3, 0, 1) = 7e6f;
  real.at(0, 1, 1) = 1;
  real.at(3, 0, 1) = 1;
  const RealismScores scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_EQ(scores.pool_mse_2, 0);
  EXPECT_DOUBLE_EQ(scores.events_per_pixel, 2.0 / 6);
}

TEST(RealismScores, DoNotMakeAFaintVolumeStrong) {
  Voxels ours({1, {2, 2}});
  Voxels real({1, {2, 2}});
  ours.at(0, 0, 0) = 0.25f;
  real.at(0, 0, 0) = 1;
  const RealismScores scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_DOUBLE_EQ(scores.events_per_pixel, 0.25 / 4);
  EXPECT_DOUBLE_EQ(scores.pool_mse_2, 0.75 * 0.75 / 16 / 2);  // one block a polarity
}

TEST(RealismScores, TimeCorrelationIsPearsonOfTheMeanTimes) {
  // Bins at 0.1, 0.55, 1. Times 0.1, 0.55, 1 against 0.1, 1, 0.55, and 0 at the other five of the
  // two polarities' eight pixels: both sums are 1.65, the squares' 1.3125, the products' 1.11.
  Voxels ours({3, {1, 4}});
  Voxels real({3, {1, 4}});
  for (const int x : {0, 1, 2}) ours.at(x, 0, x) = 1;
  real.at(0, 0, 0) = 1;
  real.at(2, 0, 1) = 1;
  real.at(1, 0, 2) = 1;
  const double mean_part = 1.65 * 1.65 / 8;
  EXPECT_NEAR(scores_of(ours.values, real.values, ours.shape).time_correlation,
              (1.11 - mean_part) / (1.3125 - mean_part), 1e-4);
}

TEST(RealismScores, ThePolaritiesTimesAreApart) {
  // Positive early and negative late at one pixel against the opposite.
  Voxels ours({2, {1, 1}});
  Voxels real({2, {1, 1}});
  ours.at(0, 0, 0) = 1;
  ours.at(3, 0, 0) = 1;
  real.at(1, 0, 0) = 1;
  real.at(2, 0, 0) = 1;
  EXPECT_NEAR(scores_of(ours.values, real.values, ours.shape).time_correlation, -1, 1e-12);
}

TEST(RealismScores, WhereOneHasNoEventsItsTimeIsZero) {
  Voxels ours({2, {1, 4}});
  Voxels real({2, {1, 4}});
  ours.at(0, 0, 0) = 1;
  ours.at(1, 0, 1) = 1;
  real.at(0, 0, 0) = 1;
  real.at(1, 0, 2) = 1;
  // (0.1, 1, 0, ..) against (0.1, 0, 1, ..), eight pixels, sum 1.1 each.
  const double expected = (0.01 - 1.21 / 8) / (1.01 - 1.21 / 8);
  EXPECT_NEAR(scores_of(ours.values, real.values, ours.shape).time_correlation, expected, 1e-4);
  // A trace of 0.005 at the last pixel is no event: nothing changes.
  ours.at(1, 0, 3) = 0.005f;
  const RealismScores scores = scores_of(ours.values, real.values, ours.shape);
  EXPECT_NEAR(scores.time_correlation, expected, 1e-4);
  EXPECT_DOUBLE_EQ(scores.f1_raw, 0.5);
}

TEST(RealismScores, PolarityCorrelationIsWithTheChangeOfLogIntensity) {
  // ln((u' + 1)/(u + 1)) = ln 2, -ln 2, 0: twice as bright at the first pixel, half at the second.
  const VolumeShape shape{1, {1, 3}};
  const GreyImage previous{shape.size, {0, 1, 9}};
  const GreyImage next{shape.size, {1, 0, 9}};
  const std::vector<float> up_down{1, 0, 0, 0, 1, 0};
  const std::vector<float> down_up{0, 1, 0, 1, 0, 0};
  EXPECT_NEAR(realism_scores(up_down, up_down, shape, previous, next).polarity_correlation, 1,
              1e-12);
  EXPECT_NEAR(realism_scores(down_up, up_down, shape, previous, next).polarity_correlation, -1,
              1e-12);
  EXPECT_THAT(realism_scores(up_down, up_down, shape, next, next).polarity_correlation, IsNan());
}

TEST(RealismScores, AmountsAreOfTheComparedVolume) {
  Voxels ours({2, {1, 2}});
  ours.at(0, 0, 0) = 3;
  ours.at(3, 0, 0) = 3;
  ours.at(3, 0, 1) = 3;
  const RealismScores scores = scores_of(ours.values, Voxels(ours.shape).values, ours.shape);
  EXPECT_THAT(scores.events_per_channel, ElementsAre(0.5, 0.0, 0.0, 1.0));
  EXPECT_THAT(scores.events_per_bin(), ElementsAre(0.5, 1.0));
  EXPECT_DOUBLE_EQ(scores.events_per_pixel, 1.5);
  EXPECT_DOUBLE_EQ(scores.positive_share, 1.0 / 3);
}

TEST(RealismScores, EmptyVolumesMatchEachOtherAndMissAllEvents) {
  Voxels empty({9, {3, 5}});
  const RealismScores scores = scores_of(empty.values, empty.values, empty.shape);
  EXPECT_EQ(scores.f1_raw, 1);
  EXPECT_EQ(scores.f1_time, 1);
  EXPECT_EQ(scores.f1_time_polarity, 1);
  EXPECT_EQ(scores.pool_mse_2, 0);
  EXPECT_EQ(scores.events_per_pixel, 0);
  EXPECT_THAT(scores.time_correlation, IsNan());
  EXPECT_THAT(scores.polarity_correlation, IsNan());
  EXPECT_THAT(scores.positive_share, IsNan());
  empty = Voxels({1, {2, 2}});
  Voxels real({1, {2, 2}});
  real.at(0, 0, 0) = 1;
  for (const bool ours_empty : {true, false}) {
    const RealismScores missed = ours_empty ? scores_of(empty.values, real.values, real.shape)
                                            : scores_of(real.values, empty.values, real.shape);
    EXPECT_EQ(missed.f1_raw, 0);
    EXPECT_EQ(missed.f1_time_polarity, 0);
    EXPECT_DOUBLE_EQ(missed.pool_mse_2, 1.0 / 16 / 2);
  }
}

TEST(RealismScores, RefuseWhatIsNoVolumeOfTheFrames) {
  const VolumeShape shape{1, {1, 2}};
  const std::vector<float> volume(4, 0.0f);
  const GreyImage frame = dark(shape.size);
  EXPECT_THROWS(realism_scores({}, volume, shape, frame, frame), std::invalid_argument,
                "expected a volume [2, H, W] of 2x1 pixels, got 0 values");
  EXPECT_THROWS(realism_scores(volume, {}, shape, frame, frame), std::invalid_argument,
                "expected a volume [2, H, W] of 2x1 pixels, got 0 values");
  EXPECT_THROWS(realism_scores(volume, volume, shape, frame, dark({2, 1})), std::invalid_argument,
                "expected a frame of 2x1 pixels, got 2 pixels");
  EXPECT_THROWS(realism_scores({}, {}, {1, {0, 0}}, dark({0, 0}), dark({0, 0})),
                std::invalid_argument, "expected a volume [2, H, W] of 0x0 pixels, got 0 values");
  EXPECT_THROWS(realism_scores({}, {}, {0, shape.size}, frame, frame), std::invalid_argument,
                "expected a volume [0, H, W] of 2x1 pixels, got 0 values");
  for (const float bad : {kNaN, std::numeric_limits<float>::infinity(), -1.0f}) {
    const std::vector<float> unsound{0, bad, 0, 0};
    EXPECT_THROWS(realism_scores(unsound, volume, shape, frame, frame), std::invalid_argument,
                  "expected finite values >= 0");
    EXPECT_THROWS(realism_scores(volume, unsound, shape, frame, frame), std::invalid_argument,
                  "expected finite values >= 0");
  }
}

TEST(MatchScores, AreThoseThatNeedNoFrames) {
  const VolumeShape shape{2, {1, 2}};
  const std::vector<float> volume{0.5f, 0, 0, 0.5f, 0, 0, 0, 1};
  const std::vector<float> real{0.5f, 0, 0, 0, 0, 1, 0, 0};
  const RealismScores all = scores_of(volume, real, shape);
  const RealismScores match = match_scores(volume, real, shape);
  EXPECT_DOUBLE_EQ(match.f1_raw, 2.0 / 5);  // one voxel in common, of 3 and 2
  EXPECT_EQ(match.f1_time, all.f1_time);
  EXPECT_EQ(match.f1_time_polarity, all.f1_time_polarity);
  EXPECT_EQ(match.time_correlation, all.time_correlation);
  for (const double without : {match.pool_mse_2, match.pool_mse_4, match.polarity_correlation,
                               match.events_per_pixel, match.positive_share}) {
    EXPECT_THAT(without, IsNan());
  }
  EXPECT_THROWS(match_scores(volume, std::span(real).first(4), shape), std::invalid_argument,
                "expected a volume [4, H, W] of 2x1 pixels, got 4 values");
}

TEST(EventsOverTime, AreSumsPerPolarityOfValuesUpToOne) {
  const std::vector<float> volume{0.25f, 3, 0.5f, 0, 0, 0, 0, 2};
  EXPECT_THAT(events_over_time(volume, {2, {1, 2}}), ::testing::ElementsAre(0.75f, 1, 0, 1));
}

constexpr double kNoScore = std::numeric_limits<double>::quiet_NaN();

TEST(MeanScores, AreFieldByField) {
  RealismScores first;
  first.f1_raw = 1;
  first.f1_time = 2;
  first.f1_time_polarity = 3;
  first.pool_mse_2 = 4;
  first.pool_mse_4 = 5;
  first.time_correlation = 6;
  first.polarity_correlation = 7;
  first.events_per_pixel = 8;
  first.positive_share = 9;
  first.events_per_channel = {10, 20};
  RealismScores second;
  second.events_per_channel = {0, 2};
  const std::vector<RealismScores> scores{first, second};
  const RealismScores mean = mean_scores(scores);
  EXPECT_EQ(mean.f1_raw, 0.5);
  EXPECT_EQ(mean.f1_time, 1);
  EXPECT_EQ(mean.f1_time_polarity, 1.5);
  EXPECT_EQ(mean.pool_mse_2, 2);
  EXPECT_EQ(mean.pool_mse_4, 2.5);
  EXPECT_EQ(mean.time_correlation, 3);
  EXPECT_EQ(mean.polarity_correlation, 3.5);
  EXPECT_EQ(mean.events_per_pixel, 4);
  EXPECT_EQ(mean.positive_share, 4.5);
  EXPECT_THAT(mean.events_per_channel, ElementsAre(5, 11));
}

TEST(MeanScores, LeaveOutWhatHasNoMeaning) {
  std::vector<RealismScores> scores(3);
  scores[0].time_correlation = kNoScore;
  scores[1].time_correlation = 0.2;
  scores[2].time_correlation = 0.4;
  for (RealismScores& pair : scores) pair.positive_share = kNoScore;
  RealismScores mean = mean_scores(scores);
  EXPECT_NEAR(mean.time_correlation, 0.3, 1e-15);
  EXPECT_THAT(mean.positive_share, IsNan());
  mean = mean_scores({});
  EXPECT_THAT(mean.f1_raw, IsNan());
  EXPECT_THAT(mean.events_per_channel, IsEmpty());
  scores = std::vector<RealismScores>(2);
  scores[1].events_per_channel = {1};
  EXPECT_THROWS(mean_scores(scores), std::invalid_argument,
                "expected scores with one number of channels, got 0 and 1");
}

TEST(ShareDistance, IsOfTheSharesAlone) {
  RealismScores scores, real;
  scores.events_per_channel = {0.3, 0.1};
  scores.events_per_pixel = 0.4;
  real.events_per_channel = {0.2, 0.2};
  real.events_per_pixel = 0.4;
  EXPECT_DOUBLE_EQ(share_distance(scores, real), 0.5);  // |3/4 - 1/2| + |1/4 - 1/2|
  real.events_per_channel = {30, 10};
  real.events_per_pixel = 40;
  EXPECT_NEAR(share_distance(scores, real), 0, 1e-15);
  real.events_per_channel = {0, 0};
  real.events_per_pixel = 0;
  EXPECT_THAT(share_distance(scores, real), IsNan());
  EXPECT_THAT(share_distance({}, {}), IsNan());
  EXPECT_THROWS(share_distance(scores, {}), std::invalid_argument,
                "expected scores with one number of channels, got 0 and 2");
}

TEST(Quantile, LiesBetweenNeighbours) {
  const std::array numbers{1.0, 2.0, 4.0};
  EXPECT_EQ(quantile(numbers, 0), 1);
  EXPECT_EQ(quantile(numbers, 0.5), 2);
  EXPECT_EQ(quantile(numbers, 0.75), 3);
  EXPECT_EQ(quantile(numbers, 1), 4);
  EXPECT_DOUBLE_EQ(quantile(std::array{0.0, 10.0}, 0.1), 1);
  EXPECT_EQ(quantile(std::array{7.0}, 0.9), 7);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(MeanBounds, AreTwoStandardErrorsFromTheMean) {
  std::vector<RealismScores> scores(400);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    scores[i].f1_time = i % 2 == 0 ? 1 : 0;  // standard error 0.5 / sqrt(400) = 0.025
    scores[i].pool_mse_2 = 0.25;
    scores[i].time_correlation = i < 2 ? 0.5 : kNoScore;
    scores[i].positive_share = kNoScore;
    scores[i].events_per_channel = {1, i % 2 == 0 ? 3.0 : 1.0};
  }
  const ScoreBounds bounds = mean_bounds(scores);
  EXPECT_NEAR(bounds.low.f1_time, 0.5 - 1.96 * 0.025, 0.006);
  EXPECT_NEAR(bounds.high.f1_time, 0.5 + 1.96 * 0.025, 0.006);
  EXPECT_EQ(bounds.low.pool_mse_2, 0.25);
  EXPECT_EQ(bounds.high.pool_mse_2, 0.25);
  EXPECT_EQ(bounds.high.time_correlation, 0.5);  // draws without a number are left out
  EXPECT_THAT(bounds.high.positive_share, IsNan());
  ASSERT_EQ(bounds.low.events_per_channel.size(), 2u);
  EXPECT_EQ(bounds.low.events_per_channel[0], 1);
  EXPECT_NEAR(bounds.high.events_per_channel[1], 2 + 1.96 * 0.05, 0.012);
}

TEST(MeanBounds, AreNotToldOfTwoPairs) {
  const ScoreBounds bounds = mean_bounds(std::vector<RealismScores>(2));
  EXPECT_THAT(bounds.low.f1_time, IsNan());
  EXPECT_THAT(bounds.high.f1_time, IsNan());
  EXPECT_THAT(mean_bounds({}).low.f1_time, IsNan());
}

TEST(BootstrapBounds, DrawAsManyPairsAsThereAreAlwaysTheSame) {
  std::vector<std::vector<std::size_t>> draws;
  const auto statistic = [&](std::span<const std::size_t> drawn) {
    draws.emplace_back(drawn.begin(), drawn.end());
    return static_cast<double>(drawn[0]);
  };
  const Bounds bounds = bootstrap_bounds(5, statistic);
  EXPECT_EQ(bounds.low, 0);  // each of five is the first in far more than 2.5 % of the draws
  EXPECT_EQ(bounds.high, 4);
  const std::vector<std::vector<std::size_t>> first = draws;
  draws.clear();
  bootstrap_bounds(5, statistic);
  EXPECT_EQ(draws, first);
  for (const auto& draw : first) {
    ASSERT_EQ(draw.size(), 5u);
    for (const std::size_t pair : draw) ASSERT_LT(pair, 5u);
  }
}

}  // namespace
}  // namespace eventgan
