#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/images/image_file.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/testing/texts.h"

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

TEST(EncodeImage, NumbersAreColoursUnlessTheyAreTooMany) {
  std::vector<std::uint16_t> indices;
  for (int i = 0; i < 5 * 51; ++i) indices.push_back(static_cast<std::uint16_t>(i));
  const auto read = [](const std::string& png, int how) {
    return cv::imdecode(std::vector<char>(png.begin(), png.end()), how);
  };
  const std::string few = encode_index_png({5, 51}, indices);
  EXPECT_EQ(few[24], 8);  // the header's bits and kind of colour
  EXPECT_EQ(few[25], 3);
  const cv::Mat colours = read(few, cv::IMREAD_COLOR);
  ASSERT_EQ(colours.size(), cv::Size(51, 5));
  EXPECT_EQ(colours.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 0));
  EXPECT_EQ(colours.at<cv::Vec3b>(0, 1), cv::Vec3b(0, 0, 128));       // as Pascal VOC's aeroplanes
  EXPECT_EQ(colours.at<cv::Vec3b>(0, 15), cv::Vec3b(128, 128, 192));  // and its persons
  EXPECT_EQ(colours.at<cv::Vec3b>(4, 50), cv::Vec3b(192, 224, 96));

  indices[7] = 255;
  indices[8] = 65535;
  const std::string many = encode_index_png({5, 51}, indices);
  const cv::Mat wide = read(many, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(wide.type(), CV_16UC1);
  EXPECT_TRUE(std::equal(indices.begin(), indices.end(), wide.begin<std::uint16_t>()));
  EXPECT_THROWS(encode_index_png({0, 0}, {}), std::runtime_error, "cannot encode an image");
}

TEST(EncodeImage, WidePngHasEveryBit) {
  std::vector<std::uint16_t> rgb;
  for (int i = 0; i < 3 * 4 * 5; ++i) rgb.push_back(static_cast<std::uint16_t>(65535 - 1091 * i));
  const std::string png = encode_wide_png({4, 5}, rgb);
  const cv::Mat read =
      cv::imdecode(std::vector<char>(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.type(), CV_16UC3);
  ASSERT_EQ(read.size(), cv::Size(5, 4));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(read.at<cv::Vec3w>(i / 5, i % 5),
              cv::Vec3w(rgb[3 * i + 2], rgb[3 * i + 1], rgb[3 * i]));
  }
}

TEST(EncodeImage, RefusesWhatTheFormatsCannotHold) {
  const std::vector<std::uint8_t> row(3 * 65501);
  EXPECT_THROWS(encode_jpeg({{1, 65501}, row.data()}, 90), std::runtime_error,
                "cannot encode an image");
  EXPECT_THROWS(encode_jpeg({{0, 0}, row.data()}, 90), std::runtime_error,
                "cannot encode an image");
  EXPECT_THROWS(encode_png({{0, 0}, row.data()}), std::runtime_error, "cannot encode an image");
}

}  // namespace
}  // namespace eventgan
