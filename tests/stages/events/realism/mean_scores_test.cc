#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "stages/events/realism/realism_scores.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::IsNan;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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
  first.events_per_bin = {10, 20};
  RealismScores second;
  second.events_per_bin = {0, 2};
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
  EXPECT_THAT(mean.events_per_bin, ElementsAre(5, 11));
}

TEST(MeanScores, LeaveOutWhatHasNoMeaning) {
  std::vector<RealismScores> scores(3);
  scores[0].time_correlation = kNaN;
  scores[1].time_correlation = 0.2;
  scores[2].time_correlation = 0.4;
  for (RealismScores& pair : scores) pair.positive_share = kNaN;
  const RealismScores mean = mean_scores(scores);
  EXPECT_NEAR(mean.time_correlation, 0.3, 1e-15);
  EXPECT_THAT(mean.positive_share, IsNan());
}

TEST(MeanScores, OfNoPairsAreNaN) {
  const RealismScores mean = mean_scores({});
  EXPECT_THAT(mean.f1_raw, IsNan());
  EXPECT_THAT(mean.events_per_bin, IsEmpty());
}

TEST(MeanScores, RefuseDifferentNumbersOfBins) {
  std::vector<RealismScores> scores(2);
  scores[1].events_per_bin = {1};
  EXPECT_THROW(mean_scores(scores), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
