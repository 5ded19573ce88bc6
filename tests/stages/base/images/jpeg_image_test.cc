#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/images/image_codecs.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::gradient_image;
using testing::opencv_read;
using testing::read_file;
using testing::same_pixels;
using testing::TemporaryFolder;
using testing::with_open;
using testing::write_file;

std::string why_jpeg_refused(const std::filesystem::path& file) {
  return testing::why_refused(file, decode_jpeg);
}

struct JpegKind {
  const char* name;
  ImageSize size;
  int opencv_type;
  std::vector<int> parameters;
};

class JpegKinds : public ::testing::TestWithParam<JpegKind> {};

TEST_P(JpegKinds, DecodesToTheSamePixelsAsOpenCv) {
  const TemporaryFolder folder;
  const auto file = folder / "image.jpg";
  cv::Mat image = gradient_image(GetParam().size);
  if (GetParam().opencv_type == CV_8UC1) cv::extractChannel(image, image, 2);
  ASSERT_TRUE(cv::imwrite(file.string(), image, GetParam().parameters));

  EXPECT_TRUE(same_pixels(with_open(file, decode_jpeg), opencv_read(file)));
  EXPECT_EQ(with_open(file, jpeg_size), GetParam().size);
}

INSTANTIATE_TEST_SUITE_P(
    , JpegKinds,
    ::testing::Values(JpegKind{"colour", {64, 96}, CV_8UC3, {}},
                      JpegKind{"one_pixel", {1, 1}, CV_8UC3, {}},
                      JpegKind{"odd_size", {13, 17}, CV_8UC3, {}},
                      JpegKind{"grey", {33, 20}, CV_8UC1, {}},
                      JpegKind{"progressive", {64, 96}, CV_8UC3, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}},
                      JpegKind{"restarts", {64, 96}, CV_8UC3, {cv::IMWRITE_JPEG_RST_INTERVAL, 2}}),
    [](const auto& param) { return param.param.name; });

TEST(JpegImage, EveryTruncationIsRefused) {
  for (const int progressive : {0, 1}) {
    const TemporaryFolder folder;
    const auto file = folder / "image.jpg";
    cv::imwrite(file.string(), gradient_image({64, 96}),
                {cv::IMWRITE_JPEG_PROGRESSIVE, progressive});
    const std::string bytes = read_file(file);
    // The last two bytes are the end marker: without it all pixels are there, the file is not
    // whole.
    for (std::size_t length = bytes.size() - 2; length > 3; length = length * 9 / 10) {
      write_file(file, bytes.substr(0, length));
      EXPECT_NE(why_jpeg_refused(file), "") << length << " of " << bytes.size() << " bytes";
    }
  }
}

TEST(JpegImage, AHoleInTheMiddleIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "image.jpg";
  cv::imwrite(file.string(), gradient_image({64, 96}));
  std::string bytes = read_file(file);
  // Half-written: the last half of the blocks on disk is still zero.
  for (std::size_t i = bytes.size() / 2; i < bytes.size(); ++i) bytes[i] = 0;
  write_file(file, bytes);
  EXPECT_NE(why_jpeg_refused(file), "");
}

TEST(JpegImage, OrientationTagIsNotApplied) {
  const TemporaryFolder folder;
  const auto file = folder / "image.jpg";
  cv::imwrite(file.string(), gradient_image({40, 60}));
  const std::string bytes = read_file(file);
  const cv::Mat stored = opencv_read(file);
  write_file(file, testing::with_orientation(bytes, 6));
  ASSERT_EQ(cv::imread(file.string()).rows, 60) << "the tag is not understood, so it tests nothing";

  EXPECT_TRUE(same_pixels(with_open(file, decode_jpeg), stored));
}

TEST(JpegImage, HugeAnnouncedSizeIsRefusedByName) {
  const TemporaryFolder folder;
  const auto file = folder / "image.jpg";
  cv::imwrite(file.string(), gradient_image({16, 16}));
  std::string bytes = read_file(file);
  // Baseline frame header: FF C0, length (2), precision (1), height (2), width (2).
  const std::size_t header = bytes.find("\xff\xc0");
  ASSERT_NE(header, std::string::npos);
  bytes.replace(header + 5, 4, "\xea\x60\xea\x60");  // 60000 x 60000
  write_file(file, bytes);
  EXPECT_NE(why_jpeg_refused(file).find("60000x60000"), std::string::npos)
      << why_jpeg_refused(file);
  EXPECT_THROWS(with_open(file, jpeg_size), std::runtime_error,
                "a size of 60000x60000, not 1 to 67108864 pixels");
}

TEST(JpegImage, RealFramesEqualOpenCv) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto human = data / "human36m_fetch/S1/Directions-1/imageSequence";
  for (const auto& file : {data / "mpii/images/000000001.jpg", data / "mpii/images/052475643.jpg",
                           data / "mpii/images/060754485.jpg", human / "54138969/img_000001.jpg",
                           human / "55011271/img_000041.jpg"}) {
    EXPECT_TRUE(same_pixels(with_open(file, decode_jpeg), opencv_read(file))) << file;
  }
}

}  // namespace
}  // namespace eventgan
