#include "stages/scenes/picture.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

TEST(Picture, PixelsAreRoundedAndKeptInRange) {
  Picture picture = black_picture({2, 3});
  set_pixel(picture, 2, 1, {-5, 99.6f, 300});
  const std::size_t last = 3 * (1 * 3 + 2);
  EXPECT_EQ(picture.bgr[last], 0);
  EXPECT_EQ(picture.bgr[last + 1], 100);
  EXPECT_EQ(picture.bgr[last + 2], 255);
  EXPECT_EQ(picture.bgr[0], 0);
}

TEST(Picture, PngHoldsThePixels) {
  const testing::TemporaryFolder folder;
  Picture picture = black_picture({4, 5});
  set_pixel(picture, 3, 2, {10, 20, 30});
  write_png(picture, folder / "p.png");
  const cv::Mat read = cv::imread((folder / "p.png").string());
  ASSERT_EQ(read.size(), cv::Size(5, 4));
  EXPECT_EQ(read.at<cv::Vec3b>(2, 3), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(read.at<cv::Vec3b>(2, 2), cv::Vec3b(0, 0, 0));
}

TEST(Picture, ColoursMix) {
  const Colour middle = mix({0, 100, 200}, {100, 200, 0}, 0.25f);
  EXPECT_FLOAT_EQ(middle.blue, 25);
  EXPECT_FLOAT_EQ(middle.green, 125);
  EXPECT_FLOAT_EQ(middle.red, 150);
}

}  // namespace
}  // namespace eventgan
