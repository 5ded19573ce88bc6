#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "stages/events/pictures/time_panel_internal.h"

namespace eventgan {
namespace {

constexpr VolumeShape kPixel{9, {1, 1}};

/// The panel's one pixel for a volume of one pixel with `value` in one channel.
cv::Vec3b pixel_of(int channel, float value) {
  std::vector<float> volume(kPixel.value_count(), 0.0f);
  volume[channel] = value;
  return time_panel(volume, kPixel).at<cv::Vec3b>(0, 0);
}

int brightest(const cv::Vec3b& pixel) { return std::max({pixel[0], pixel[1], pixel[2]}); }

TEST(TimePanel, EarlyIsBlueAndLateIsRedInEitherPolarity) {
  for (const int polarity : {0, 9}) {
    const cv::Vec3b early = pixel_of(polarity + 0, 10);
    const cv::Vec3b middle = pixel_of(polarity + 4, 10);
    const cv::Vec3b late = pixel_of(polarity + 8, 10);
    EXPECT_EQ(brightest(early), early[0]);
    EXPECT_EQ(brightest(middle), middle[1]);
    EXPECT_EQ(brightest(late), late[2]);
  }
}

TEST(TimePanel, PolaritiesAreWeightedByTheirEvents) {
  std::vector<float> volume(kPixel.value_count(), 0.0f);
  volume[0] = 3;      // positive, time 0.1
  volume[9 + 8] = 1;  // negative, time 1
  // (3 * 0.1 + 1 * 1) / 4 = 0.325; brightness 1 - exp(-4) = 0.98.
  const cv::Vec3b expected = time_colour(0.325f);
  const cv::Vec3b pixel = time_panel(volume, kPixel).at<cv::Vec3b>(0, 0);
  for (int channel = 0; channel < 3; ++channel) {
    EXPECT_NEAR(pixel[channel], expected[channel] * 0.98, 2);
  }
}

TEST(TimePanel, BrightnessIsAbsolute) {
  EXPECT_EQ(brightest(pixel_of(4, 0)), 0);
  // 1 - exp(-0.02) = 2 % of at most 255: noise stays faint.
  EXPECT_LE(brightest(pixel_of(4, 0.02f)), 6);
  EXPECT_GT(brightest(pixel_of(4, 0.02f)), 0);
  EXPECT_GT(brightest(pixel_of(4, 5)), 200);
  EXPECT_GT(brightest(pixel_of(4, std::numeric_limits<float>::max())), 200);
}

TEST(TimePanel, UnsoundValuesAreWhite) {
  const cv::Vec3b white(255, 255, 255);
  EXPECT_EQ(pixel_of(3, std::numeric_limits<float>::quiet_NaN()), white);
  EXPECT_EQ(pixel_of(12, std::numeric_limits<float>::infinity()), white);
}

TEST(TimePanel, OtherNumbersOfBins) {
  EXPECT_EQ(time_panel(std::vector<float>(2 * 6, 1.0f), {1, {2, 3}}).size(), cv::Size(3, 2));
}

}  // namespace
}  // namespace eventgan
