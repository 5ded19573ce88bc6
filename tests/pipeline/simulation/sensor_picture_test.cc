#include "pipeline/simulation/sensor_picture.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

/// Grey columns of these values.
ColourFrame columns(int height, const std::vector<int>& values) {
  ColourFrame frame{{height, static_cast<int>(values.size())}, {}};
  for (int y = 0; y < height; ++y) {
    for (const int value : values)
      frame.bgr.insert(frame.bgr.end(), 3, static_cast<std::uint8_t>(value));
  }
  return frame;
}

TEST(SensorPicture, IsGreyByBt601) {
  // 0.114 x 200 = 22.8 of blue alone.
  const ColourFrame blue{{1, 1}, {200, 0, 0}};
  EXPECT_EQ(sensor_picture(blue, std::nullopt), (GreyImage{{1, 1}, {23}}));
}

TEST(SensorPicture, ShrinksByAveragingAndCutsAroundTheCentre) {
  // 8 x 2 covers 2 x 1 by the scale 1/2: 4 x 1, of which the middle two are left.
  const ColourFrame frame = columns(2, {0, 0, 10, 30, 100, 200, 0, 0});
  EXPECT_EQ(sensor_picture(frame, ImageSize{1, 2}), (GreyImage{{1, 2}, {20, 150}}));
}

TEST(SensorPicture, GrowsToCover) {
  const GreyImage picture = sensor_picture(columns(2, {50, 50}), ImageSize{6, 4});
  EXPECT_EQ(picture, (GreyImage{{6, 4}, std::vector<std::uint8_t>(24, 50)}));
}

TEST(SensorPicture, OfItsOwnSizeIsUntouched) {
  const ColourFrame frame = columns(3, {0, 255, 3});
  EXPECT_EQ(sensor_picture(frame, ImageSize{3, 3}), sensor_picture(frame, std::nullopt));
  EXPECT_EQ(sensor_picture(frame, std::nullopt).pixels,
            (std::vector<std::uint8_t>{0, 255, 3, 0, 255, 3, 0, 255, 3}));
}

}  // namespace
}  // namespace eventgan
