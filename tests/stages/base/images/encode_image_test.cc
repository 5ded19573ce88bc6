#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "stages/base/images/image_file.h"
#include "tests/stages/base/images/test_images.h"

namespace eventgan {
namespace {

ColourView view(const cv::Mat& image) { return {{image.rows, image.cols}, image.data}; }

TEST(EncodeImage, PngHasThePixels) {
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{64, 97}}) {
    const cv::Mat image = testing::gradient_image(size);
    const std::string png = encode_png(view(image));
    const cv::Mat read = cv::imdecode(std::vector<char>(png.begin(), png.end()), cv::IMREAD_COLOR);
    EXPECT_EQ(cv::norm(read, image, cv::NORM_INF), 0);
  }
}

TEST(EncodeImage, JpegIsWhatOpenCvMakes) {
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{64, 97}}) {
    for (const int quality : {1, 50, 90, 100}) {
      const cv::Mat image = testing::gradient_image(size);
      std::vector<std::uint8_t> expected;
      cv::imencode(".jpg", image, expected, {cv::IMWRITE_JPEG_QUALITY, quality});
      EXPECT_EQ(encode_jpeg(view(image), quality), std::string(expected.begin(), expected.end()));
    }
  }
}

TEST(EncodeImage, RefusesWhatTheFormatsCannotHold) {
  const std::vector<std::uint8_t> row(3 * 65501);
  EXPECT_THROW(encode_jpeg({{1, 65501}, row.data()}, 90), std::runtime_error);
  EXPECT_THROW(encode_jpeg({{0, 0}, row.data()}, 90), std::runtime_error);
  EXPECT_THROW(encode_png({{0, 0}, row.data()}), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
