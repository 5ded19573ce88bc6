#include "stages/events/images/image_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

#include "manifests/values/counter_random.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// Of noise, which compresses worst.
ColourFrame noise(ImageSize size) {
  ColourFrame image{size, std::vector<std::uint8_t>(3 * size.pixel_count())};
  const CounterRandom random(3);
  for (std::size_t i = 0; i < image.bgr.size(); ++i) {
    image.bgr[i] = static_cast<std::uint8_t>(random.bits(i));
  }
  return image;
}

ColourFrame plain(ImageSize size, std::uint8_t grey) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), grey)};
}

TEST(ImageOutput, APngHasThePixelsAndErrorsNameThePath) {
  const testing::TemporaryFolder folder;
  const ColourFrame image = noise({7, 9});
  write_png(image, folder / "p.png");
  const cv::Mat read = cv::imread((folder / "p.png").string());
  ASSERT_EQ(read.size(), cv::Size(9, 7));
  EXPECT_EQ(std::vector<std::uint8_t>(read.data, read.data + 3 * 63), image.bgr);
  EXPECT_THROWS(write_png(plain({4, 4}, 1), folder / "none/p.png"), std::runtime_error,
                (folder / "none").string());
}

TEST(ImageOutput, AJpegIsNoLargerThanAsked) {
  const ColourFrame image = noise({200, 300});
  for (const std::size_t most : {200'000, 20'000, 2'000}) {
    const std::string jpeg = jpeg_of(image, most);
    EXPECT_LE(jpeg.size(), most);
    const cv::Mat read = cv::imdecode(
        cv::Mat(1, static_cast<int>(jpeg.size()), CV_8U, const_cast<char*>(jpeg.data())),
        cv::IMREAD_COLOR);
    ASSERT_FALSE(read.empty());
    EXPECT_EQ(read.cols < 300, most < 20'000) << "smaller only if no quality does";
  }
}

}  // namespace
}  // namespace eventgan
