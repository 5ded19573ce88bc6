#include <gtest/gtest.h>

#include <vector>

#include "stages/events/realism/time_slope_internal.h"

namespace eventgan {
namespace {

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

constexpr VolumeShape kShape{3, {3, 3}};

TEST(TimeSlope, IsOfBothPolaritiesTogether) {
  const TimeSlope slope = time_slope(sloped_volume(kShape), kShape, 0.1);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) {
      EXPECT_EQ(slope.known(y, x), 255);
      EXPECT_NEAR(slope.x(y, x), 0.2, 1e-6);
      EXPECT_NEAR(slope.y(y, x), 0.1, 1e-6);
    }
  }
}

TEST(TimeSlope, LooksOnlyAtPixelsWithEvents) {
  std::vector<float> volume = sloped_volume(kShape);
  erase_pixel(volume, 1, 0);
  erase_pixel(volume, 0, 2);
  erase_pixel(volume, 2, 2);
  const TimeSlope slope = time_slope(volume, kShape, 0.1);
  EXPECT_EQ(slope.event(1, 0), 0);
  EXPECT_EQ(slope.known(1, 0), 0);
  EXPECT_NEAR(slope.x(1, 1), 0.2, 1e-6);  // from the right neighbour alone
  EXPECT_EQ(slope.known(1, 2), 0);        // nothing above or below
  EXPECT_EQ(slope.known(0, 0), 0);        // nothing below
  EXPECT_EQ(slope.known(0, 1), 255);
}

TEST(TimeSlope, FaintVolumeIsNoEvent) {
  std::vector<float> volume = sloped_volume(kShape);
  for (float& value : volume) value *= 0.05f;
  EXPECT_EQ(cv::countNonZero(time_slope(volume, kShape, 0.1).event), 0);
  const std::vector<float> empty(kShape.value_count(), 0.0f);
  EXPECT_EQ(cv::countNonZero(time_slope(empty, kShape, 0).event), 0);
}

TEST(TimeSlope, OfOneBinOrOnePixelIsFlat) {
  const std::vector<float> volume(2 * 6, 1.0f);
  EXPECT_EQ(cv::countNonZero(time_slope(volume, {1, {2, 3}}, 0.1).x), 0);
  const std::vector<float> pixel(6, 1.0f);
  EXPECT_EQ(cv::countNonZero(time_slope(pixel, {3, {1, 1}}, 0.1).known), 0);
}

}  // namespace
}  // namespace eventgan
