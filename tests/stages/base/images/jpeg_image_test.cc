#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/images/image_codecs.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

// jpeglib.h needs <cstddef> and <cstdio> above it.
// clang-format off
#include <jpeglib.h>
// clang-format on

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
  for (const auto& [by, flag] : {std::pair{2, cv::IMREAD_REDUCED_COLOR_2},
                                 {4, cv::IMREAD_REDUCED_COLOR_4},
                                 {8, cv::IMREAD_REDUCED_COLOR_8}}) {
    const auto reduced = [&](std::FILE* open) { return decode_reduced_jpeg(open, by); };
    const bool is_whole = image.rows % by != 0 || image.cols % by != 0;
    EXPECT_TRUE(same_pixels(with_open(file, reduced),
                            is_whole ? opencv_read(file) : cv::imread(file.string(), flag)))
        << by;
  }
}

INSTANTIATE_TEST_SUITE_P(
    , JpegKinds,
    ::testing::Values(JpegKind{"colour", {64, 96}, CV_8UC3, {}},
                      JpegKind{"one_pixel", {1, 1}, CV_8UC3, {}},
                      JpegKind{"odd_size", {13, 17}, CV_8UC3, {}},
                      JpegKind{"grey", {33, 20}, CV_8UC1, {}},
                      JpegKind{"grey_to_reduce", {40, 24}, CV_8UC1, {}},
                      JpegKind{"progressive", {64, 96}, CV_8UC3, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}},
                      JpegKind{"restarts", {64, 96}, CV_8UC3, {cv::IMWRITE_JPEG_RST_INTERVAL, 2}}),
    [](const auto& param) { return param.param.name; });

/// A progressive JPEG of 8x8 grey pixels: the mean, then each of `bands` frequencies bit by bit,
/// from the 11th down: 11 scans a band.
std::string jpeg_of_scans(int bands) {
  std::vector<jpeg_scan_info> scans{{1, {0}, 0, 0, 0, 0}};
  for (int band = 1; band <= bands; ++band) {
    scans.push_back({1, {0}, band, band, 0, 10});
    for (int bit = 9; bit >= 0; --bit) scans.push_back({1, {0}, band, band, bit + 1, bit});
  }
  jpeg_compress_struct codec{};
  jpeg_error_mgr errors{};
  codec.err = jpeg_std_error(&errors);
  jpeg_create_compress(&codec);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&codec, &bytes, &size);
  codec.image_width = codec.image_height = 8;
  codec.input_components = 1;
  codec.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&codec);
  codec.scan_info = scans.data();
  codec.num_scans = static_cast<int>(scans.size());
  jpeg_start_compress(&codec, TRUE);
  std::array<JSAMPLE, 8> pixels{0, 30, 60, 90, 120, 150, 180, 210};
  JSAMPROW row = pixels.data();
  while (codec.next_scanline < codec.image_height) jpeg_write_scanlines(&codec, &row, 1);
  jpeg_finish_compress(&codec);
  std::string jpeg(reinterpret_cast<const char*>(bytes), size);
  jpeg_destroy_compress(&codec);
  std::free(bytes);
  return jpeg;
}

TEST(JpegImage, MoreScansThanAnyEncoderWritesAreRefused) {
  const TemporaryFolder folder;
  write_file(folder / "few.jpg", jpeg_of_scans(45));   // 496
  write_file(folder / "many.jpg", jpeg_of_scans(63));  // 694
  EXPECT_EQ(why_jpeg_refused(folder / "few.jpg"), "");
  EXPECT_EQ(why_jpeg_refused(folder / "many.jpg"),
            "expected a JPEG of at most 500 scans, got more");
}

TEST(JpegImage, AReducedPixelLiesInTheMiddleOfThoseItStandsFor) {
  const TemporaryFolder folder;
  const auto file = folder / "image.jpg";
  cv::Mat image(64, 96, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(20 + x + y);
    }
  }
  cv::imwrite(file.string(), image, {cv::IMWRITE_JPEG_QUALITY, 100});
  for (const int by : {2, 4, 8}) {
    const ColourFrame frame =
        decode_image(open_image_file(file), ImageOrientation::kStored, {}, by);
    ASSERT_EQ(frame.size, (ImageSize{64 / by, 96 / by}));
    double difference = 0;
    for (int y = 0; y < frame.size.height; ++y) {
      for (int x = 0; x < frame.size.width; ++x) {
        const int found = frame.bgr[3 * (y * frame.size.width + x)];
        const int mean = 20 + by * (x + y) + (by - 1);
        ASSERT_NEAR(found, mean, 2) << by;
        difference += found - mean;
      }
    }
    EXPECT_NEAR(difference / static_cast<double>(frame.size.pixel_count()), 0, 0.1) << by;
  }
}

TEST(JpegImage, IsReducedWhereBothSidesAreMultiplesAlsoIfItIsTurned) {
  const TemporaryFolder folder;
  const auto file = folder / "image.jpg";
  for (const ImageSize size : {ImageSize{64, 96}, {64, 92}, {63, 96}}) {
    cv::imwrite(file.string(), gradient_image(size));
    const std::string plain = read_file(file);
    for (const int orientation : {1, 3, 6, 8}) {
      write_file(file, testing::with_orientation(plain, orientation));
      const auto decode = [&](ImageOrientation wanted, int by) {
        return decode_image(open_image_file(file), wanted, {}, by);
      };
      const int by = size == ImageSize{64, 96} ? 8 : 1;
      const ColourFrame expected = turned(decode(ImageOrientation::kStored, by), orientation);
      const ColourFrame frame = decode(ImageOrientation::kUpright, 8);
      EXPECT_EQ(frame.size, expected.size) << orientation;
      EXPECT_EQ(frame.bgr, expected.bgr) << orientation;
    }
  }
  cv::imwrite((folder / "a.png").string(), gradient_image({64, 96}));
  EXPECT_EQ(decode_image(open_image_file(folder / "a.png"), ImageOrientation::kStored, {}, 8).size,
            (ImageSize{64, 96}));
}

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
