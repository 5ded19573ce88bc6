#include "manifests/values/sensor_input.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace eventgan {
namespace {

/// A grey level 0..255 as frames have it.
float frame_value(double level) { return static_cast<float>(level / 127.5 - 1); }

/// The third plane of one pixel that goes from one grey level to another.
float change(double previous, double next, const ContrastThreshold& threshold) {
  const std::vector<float> frames{frame_value(previous), frame_value(next)};
  return sensor_input(frames, threshold).at(2);
}

double log_of(int level) { return std::log(level / 255.0 + 0.02); }

TEST(ContrastThreshold, IsTheGeometricMeanOfItsPolarities) {
  const ContrastThreshold threshold{0.3, 4};
  EXPECT_DOUBLE_EQ(threshold.positive(), 0.15);
  EXPECT_DOUBLE_EQ(threshold.negative(), 0.6);
  EXPECT_EQ(ContrastThreshold{0.3}.positive(), 0.3);
  EXPECT_EQ(ContrastThreshold{0.3}.negative(), 0.3);
}

TEST(ThresholdRange, HoldsItsEnds) {
  const ThresholdRange range{0.1, 0.4};
  EXPECT_DOUBLE_EQ(range.geometric_mean(), 0.2);
  EXPECT_TRUE(range.contains(0.1) && range.contains(0.25) && range.contains(0.4));
  EXPECT_FALSE(range.contains(0.0999) || range.contains(0.4001));
  EXPECT_FALSE(range.contains(std::numeric_limits<double>::quiet_NaN()));
}

TEST(SensorInput, IsTheFramesAndTheirChangeInThresholds) {
  for (const double mean : {0.1, 0.25, 1.0, 5.0}) {
    for (const int previous : {0, 1, 20, 128, 254, 255}) {
      for (const int next : {0, 1, 21, 127, 200, 255}) {
        const double change_in_ten = (log_of(next) - log_of(previous)) / (10 * mean);
        EXPECT_NEAR(change(previous, next, {mean}), std::clamp(change_in_ten, -1.0, 1.0), 1e-5)
            << previous << " to " << next << " at " << mean;
      }
    }
  }
}

TEST(SensorInput, KeepsFramesInTheirOrder) {
  const std::vector<float> frames{-1, -0.5f, 0, 0.5f, 1, 0.25f};
  const std::vector<float> planes = sensor_input(frames, {0.2});
  ASSERT_EQ(planes.size(), 9u);
  EXPECT_TRUE(std::equal(frames.begin(), frames.end(), planes.begin()));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(planes[6 + i], sensor_input(std::vector{frames[i], frames[3 + i]}, {0.2})[2]) << i;
  }
}

TEST(SensorInput, RisesByThePositiveThresholdAndFallsByTheNegativeOne) {
  // Of a mean of 0.5 and a ratio of 4 they are 0.25 and 1.
  const double step = log_of(140) - log_of(100);
  EXPECT_NEAR(change(100, 140, {0.5, 4}), step / 2.5, 1e-6);
  EXPECT_NEAR(change(140, 100, {0.5, 4}), -step / 10, 1e-6);
  EXPECT_NEAR(change(100, 140, {0.5, 0.25}), step / 10, 1e-6);
  EXPECT_NEAR(change(140, 100, {0.5, 0.25}), -step / 2.5, 1e-6);
  for (const int level : {0, 7, 255}) EXPECT_EQ(change(level, level, {0.01, 5}), 0) << level;
}

TEST(SensorInput, IsNoMoreThanTenThresholdsOfWholeGreyLevels) {
  // From black to white ln(1.02 / 0.02) = 3.93: 39 thresholds of 0.1.
  EXPECT_EQ(change(0, 255, {0.1}), 1);
  EXPECT_EQ(change(255, 0, {0.1}), -1);
  EXPECT_LT(change(0, 255, {0.4}), 1);
  EXPECT_EQ(change(0, 255, {1e-300}), 1);
  EXPECT_EQ(change(100, 140.4, {0.5}), change(100, 140, {0.5}));
  EXPECT_EQ(change(100, 139.6, {0.5}), change(100, 140, {0.5}));
  EXPECT_EQ(change(-3, 300, {0.5}), change(0, 255, {0.5}));
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(sensor_input(std::vector{-infinity, infinity}, {0.5})[2], change(0, 255, {0.5}));
  EXPECT_TRUE(sensor_input({}, {0.2}).empty());
}

TEST(SensorInput, OfAPixelThatIsNotANumberIsNone) {
  const float nan = std::nanf("");
  const std::vector<float> planes =
      sensor_input(std::vector{nan, 0.0f, 0.0f, 0.0f, nan, 0.0f}, {0.2});
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(std::isnan(planes[i]), i == 0 || i == 4 || i == 6 || i == 7) << i;
  }
  EXPECT_EQ(planes[8], 0);
}

}  // namespace
}  // namespace eventgan
