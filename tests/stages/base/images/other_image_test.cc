// WebP, TIFF, BMP and PNM.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/values/counter_random.h"
#include "stages/base/images/image_file.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using testing::gradient_image;
using ::testing::HasSubstr;
using testing::opencv_read;
using testing::read_file;
using testing::same_pixels;
using testing::TemporaryFolder;
using testing::write_file;

/// Of an image that the image's own reader refuses; "" if it does not.
std::string why_refused(const std::filesystem::path& file) try {
  decode_image_file(file);
  return "";
} catch (const std::runtime_error& error) {
  return error.what();
}

std::string why_refused(const TemporaryFolder& folder, const std::string& bytes) {
  write_file(folder / "image", bytes);
  return why_refused(folder / "image");
}

/// Grey, colour, with transparency, and the same in 16 bits.
std::vector<cv::Mat> kinds(ImageSize size) {
  const cv::Mat colour = gradient_image(size);
  std::vector<cv::Mat> channels;
  cv::split(colour, channels);
  cv::Mat transparent;
  cv::merge(std::vector<cv::Mat>{channels[0], channels[1], channels[2], channels[1]}, transparent);
  std::vector<cv::Mat> images{channels[0], colour, transparent};
  for (int i = 0; i < 3; ++i) {
    cv::Mat wide;
    images[i].convertTo(wide, CV_16U, 250, 3);
    images.push_back(wide);
  }
  return images;
}

/// Four pixels of 16 bits, blue, green, red; grey ones have the first channel thrice.
cv::Mat wide_image(bool is_colour) {
  const std::uint16_t values[2][2][3] = {{{0, 1000, 1250}, {1002, 1004, 1500}},
                                         {{1499, 1498, 1255}, {2000, 65535, 1001}}};
  cv::Mat image(2, 2, is_colour ? CV_16UC3 : CV_16UC1);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      for (int c = 0; c < image.channels(); ++c) {
        image.ptr<std::uint16_t>(y)[image.channels() * x + c] = values[y][x][c];
      }
    }
  }
  return image;
}

TEST(ImagesOfSixteenBits, AreSpreadOverTheGivenRange) {
  const TemporaryFolder folder;
  // 255 (v - 1000) / 500: 1250 becomes 127.5, rounded up; 1002, 1004: 1.02, 2.04; 1499, 1498:
  // 254.49, 253.98; 1255: 130.05; 1001: 0.51.
  const std::vector<std::uint8_t> colour{0, 0, 128, 1, 2, 255, 254, 254, 130, 255, 255, 1};
  const std::vector<std::uint8_t> grey{0, 0, 0, 1, 1, 1, 254, 254, 254, 255, 255, 255};
  for (const bool is_colour : {false, true}) {
    for (const char* ending : {"png", "tiff", is_colour ? "ppm" : "pgm"}) {
      for (const int choice : {0, 1}) {  // PNM: plain or binary; TIFF: not compressed or LZW
        const auto file = folder / "image."s.append(ending);
        ASSERT_TRUE(cv::imwrite(
            file.string(), wide_image(is_colour),
            {cv::IMWRITE_PXM_BINARY, choice, cv::IMWRITE_TIFF_COMPRESSION, choice == 0 ? 1 : 5}));
        const ColourFrame frame =
            decode_image_file(file, ImageOrientation::kStored, ValueRange{1000, 1500});
        EXPECT_EQ(frame.size, (ImageSize{2, 2}));
        EXPECT_EQ(frame.bgr, is_colour ? colour : grey) << ending << choice;
        std::vector<std::int64_t> counts(65536);
        EXPECT_TRUE(count_wide_values(open_image_file(file), counts));
        EXPECT_EQ(counts[0], is_colour ? 1 : 3);
        EXPECT_EQ(counts[65535], is_colour ? 1 : 0);
        EXPECT_EQ(counts[1002], is_colour ? 1 : 3);
        // A file that ends early has no values.
        const std::string whole = read_file(file);
        write_file(file, whole.substr(0, whole.size() - whole.size() / 4));
        EXPECT_THROWS(decode_image_file(file, ImageOrientation::kStored, ValueRange{1000, 1500}),
                      std::runtime_error, "expected a whole")
            << ending << choice;
      }
    }
  }
}

TEST(ImagesOfSixteenBits, OthersHaveNoUseForARange) {
  const TemporaryFolder folder;
  for (const char* ending : {"png", "jpg", "webp", "tiff", "bmp", "ppm"}) {
    const auto file = folder / "image."s.append(ending);
    ASSERT_TRUE(cv::imwrite(file.string(), gradient_image({11, 13})));
    EXPECT_EQ(decode_image_file(file, ImageOrientation::kStored, ValueRange{100, 200}).bgr,
              decode_image_file(file).bgr);
    std::vector<std::int64_t> counts(65536);
    EXPECT_FALSE(count_wide_values(open_image_file(file), counts));
    EXPECT_EQ(counts, std::vector<std::int64_t>(65536));
  }
}

TEST(OtherImages, HaveTheSamePixelsAsOpenCvReads) {
  const TemporaryFolder folder;
  int written = 0;
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{11, 13}, ImageSize{64, 96}}) {
    for (const cv::Mat& image : kinds(size)) {
      for (const char* ending : {"webp", "tiff", "bmp", "pgm", "ppm", "pbm"}) {
        for (const int choice : {0, 1}) {  // PNM: plain or binary; TIFF: not compressed or LZW
          const auto file = folder / "image."s.append(ending);
          const bool is_colour = image.channels() == 3;
          const bool is_wide = image.depth() == CV_16U;
          if (ending == "ppm"s ? !is_colour : ending[0] == 'p' && image.channels() > 1) continue;
          if ((ending == "pbm"s || ending == "webp"s || ending == "bmp"s) && is_wide) continue;
          ASSERT_TRUE(cv::imwrite(
              file.string(), image,
              {cv::IMWRITE_PXM_BINARY, choice, cv::IMWRITE_TIFF_COMPRESSION, choice == 0 ? 1 : 5}));
          EXPECT_TRUE(same_pixels(decode_image_file(file), opencv_read(file)))
              << ending << " of type " << image.type() << ", " << size.width;
          EXPECT_EQ(image_file_size(file), size);
          ++written;
        }
      }
    }
  }
  EXPECT_EQ(written, 3 * 2 * (3 + 6 + 3 + 2 + 2 + 1));  // by format
}

TEST(OtherImages, EveryTruncationIsRefused) {
  const TemporaryFolder folder;
  for (const char* ending : {"webp", "tiff", "bmp", "pgm", "ppm", "pbm"}) {
    for (const int choice : {0, 1}) {
      for (const int quality : {80, 101}) {  // beyond 100: without loss
        if (quality > 100 && ending != "webp"s) continue;
        const auto file = folder / "image."s.append(ending);
        const bool is_grey = ending == "pgm"s || ending == "pbm"s;
        const cv::Mat image = kinds({24, 33})[is_grey ? 0 : 1];
        ASSERT_TRUE(cv::imwrite(file.string(), image,
                                {cv::IMWRITE_PXM_BINARY, choice, cv::IMWRITE_WEBP_QUALITY, quality,
                                 cv::IMWRITE_TIFF_COMPRESSION, choice == 0 ? 1 : 5}));
        const std::string whole = read_file(file);
        ASSERT_EQ(why_refused(file), "");
        // A last line's end says nothing.
        const std::size_t last = whole.find_last_not_of(choice == 0 ? " \n" : "");
        for (std::size_t length = last; length > 12; length = length * 9 / 10) {
          EXPECT_THAT(why_refused(folder, whole.substr(0, length)), HasSubstr("expected a whole "))
              << ending << ' ' << choice << ": " << length << " of " << whole.size();
        }
      }
    }
  }
}

// Most of these bytes are pixels, which may well be others.
TEST(OtherImages, DamageIsAnErrorOrOtherPixels) {
  const TemporaryFolder folder;
  ::testing::internal::CaptureStderr();
  std::uint64_t counter = 0;
  const CounterRandom random(7);
  for (const char* ending : {"webp", "tiff", "bmp", "pgm", "ppm", "pbm"}) {
    for (const int choice : {0, 1}) {
      const auto file = folder / "image."s.append(ending);
      const bool is_grey = ending == "pgm"s || ending == "pbm"s;
      cv::imwrite(file.string(), kinds({12, 17})[is_grey ? 0 : 1],
                  {cv::IMWRITE_PXM_BINARY, choice, cv::IMWRITE_WEBP_QUALITY, 100 + choice,
                   cv::IMWRITE_TIFF_COMPRESSION, choice == 0 ? 1 : 5});
      const std::string whole = read_file(file);
      for (int i = 0; i < 100; ++i) {
        std::string damaged = whole;
        for (int change = 0; change < 3; ++change) {
          // Every second change is within the first bytes, where the header is.
          const std::size_t reach = change % 2 == 0 ? damaged.size() : 60;
          const std::size_t at = random.bits(counter++) % std::min(reach, damaged.size());
          damaged[at] = static_cast<char>(random.bits(counter++));
        }
        why_refused(folder, damaged);
      }
    }
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

/// 2 x 2 pixels of four bits, which are colours of a palette of three.
std::string small_bmp(const std::string& rows) {
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  return "BM" + number(0) + number(0) + number(14 + 40 + 12) + number(40) + number(2) + number(2) +
         "\1\0\4\0"s + number(0) + number(0) + number(0) + number(0) + number(3) + number(0) +
         "\1\2\3\0\4\5\6\0\7\x8\x9\0"s + rows;
}

TEST(OtherImages, BmpPixelsAreColoursOfThePalette) {
  const TemporaryFolder folder;
  const auto file = folder / "image";
  write_file(file, small_bmp("\x02\0\0\0\x10\0\0\0"s));
  const ColourFrame frame = decode_image_file(file);
  EXPECT_EQ(frame.bgr, (std::vector<std::uint8_t>{4, 5, 6, 1, 2, 3, 1, 2, 3, 7, 8, 9}));
  EXPECT_TRUE(same_pixels(frame, opencv_read(file)));
  EXPECT_THAT(why_refused(folder, small_bmp("\x03\0\0\0\x10\0\0\0"s)),
              HasSubstr("a pixel of colour 3 in a palette of 3"));
}

TEST(OtherImages, BmpsOfRareKindsAreNamed) {
  const TemporaryFolder folder;
  std::string bmp = small_bmp("\x02\0\0\0\x10\0\0\0"s);
  bmp[30] = 2;
  EXPECT_EQ(why_refused(folder, bmp), "expected a whole BMP, got one of 4 bits and compression 2");
  bmp[30] = 0;
  bmp[28] = 16;
  EXPECT_EQ(why_refused(folder, bmp), "expected a whole BMP, got one of 16 bits and compression 0");
  bmp[14] = 12;
  EXPECT_EQ(why_refused(folder, bmp), "expected a whole BMP, got a header of 12 bytes");
}

TEST(OtherImages, HugeAnnouncedSizesAreRefusedByName) {
  const TemporaryFolder folder;
  std::string bmp = small_bmp("");
  bmp.replace(18, 8, "\xff\xff\xff\x7f\0\0\0\x80"s);
  EXPECT_THAT(why_refused(folder, bmp), HasSubstr("a size of 2147483647x2147483647"));
  EXPECT_THAT(why_refused(folder, "P5 90000 90000 255 "), HasSubstr("a size of 90000x90000"));
  EXPECT_THAT(why_refused(folder, "P5 0 5 255 "), HasSubstr("a size of 0x5"));
  cv::imwrite((folder / "a.tiff").string(), gradient_image({6, 5}),
              {cv::IMWRITE_TIFF_COMPRESSION, 1});
  std::string tiff = read_file(folder / "a.tiff");
  const std::size_t width = tiff.find("\x00\x01\x03\x00\x01\x00\x00\x00\x05\x00"s);  // short, 1, 5
  ASSERT_NE(width, std::string::npos);
  tiff.replace(width + 2, 10, "\x04\0\1\0\0\0\xff\xff\xff\xff"s);
  EXPECT_THAT(why_refused(folder, tiff), HasSubstr("not 1 to"));
}

TEST(OtherImages, PnmHeadersHaveCommentsAndAnySpace) {
  const TemporaryFolder folder;
  const auto file = folder / "image";
  const std::vector<std::uint8_t> grey{10, 10, 10, 255, 255, 255};
  for (const std::string& bytes : {"P2\n# a 1 2\n2 1\n255\n10 255\n"s,
                                   "P2 2\t1\r\n#\n255 10\n#x\n255\n"s, "P5 2 1 255 \n\xff"s}) {
    write_file(file, bytes);
    EXPECT_EQ(decode_image_file(file).bgr, grey) << bytes;
  }
  const std::vector<std::uint8_t> third{85, 85, 85, 255, 255, 255};
  for (const std::string& bytes :
       {"P2 2 1 9 3 9\n"s, "P5 2 1 9 \x03\x09"s, "P5 2 1 4095 \x05\x55\x0f\xff"s,
        "P5 2 1 65535 \x55\x55\xff\xff"s}) {
    write_file(file, bytes);
    EXPECT_EQ(decode_image_file(file).bgr, third) << bytes;
  }
  write_file(file, "P1 3 1\n01 1\n");
  EXPECT_EQ(decode_image_file(file).bgr,
            (std::vector<std::uint8_t>{255, 255, 255, 0, 0, 0, 0, 0, 0}));
  for (const char* bytes :
       {"P2 2 1 255 10 256\n", "P2 2 1 255 10 -1\n", "P2 2 1 0 0 0\n", "P2 2 1 65536 0 0\n",
        "P2 2 1 255 10 25x\n", "P1 2 1 02\n", "P2 2 1 255 10 255", "P5 2 1 9 \x01\x0a",
        "P2 9999999999 1 255 1\n", "P2 # no end"}) {
    EXPECT_NE(why_refused(folder, bytes), "") << bytes;
  }
}

TEST(OtherImages, AnOrientationTagIsNotApplied) {
  const TemporaryFolder folder;
  // 2 x 1 grey pixels, to be shown from the other side: little endian, the directory at 8.
  const auto entry = [](int tag, int value) {
    return std::string{static_cast<char>(tag & 255),
                       static_cast<char>(tag >> 8),
                       '\3',
                       0,
                       '\1',
                       0,
                       0,
                       0,
                       static_cast<char>(value),
                       0,
                       0,
                       0};
  };
  const std::string tiff = "II*\0\x08\0\0\0\x09\0"s + entry(256, 2) + entry(257, 1) +
                           entry(258, 8) + entry(259, 1) + entry(262, 1) +
                           entry(273, 8 + 2 + 9 * 12 + 4) + entry(274, 2) + entry(278, 1) +
                           entry(279, 2) + "\0\0\0\0\x0a\xff"s;
  write_file(folder / "image", tiff);
  EXPECT_EQ(decode_image_file(folder / "image").bgr,
            (std::vector<std::uint8_t>{10, 10, 10, 255, 255, 255}));
}

TEST(OtherImages, AreToldByTheirFirstBytes) {
  const TemporaryFolder folder;
  const std::string other =
      "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM), got a file of another kind";
  for (const std::string& bytes :
       {"P7 1 1 255\n\1"s, "P5"s, "RIFF\4\0\0\0WAVE"s, "II*"s, "GIF89a"s, "B"s}) {
    EXPECT_EQ(why_refused(folder, bytes), other) << bytes;
    EXPECT_FALSE(is_image(InputFile(folder / "image")));
  }
  write_file(folder / "image", "BM");
  EXPECT_TRUE(is_image(InputFile(folder / "image")));
}

}  // namespace
}  // namespace eventgan
