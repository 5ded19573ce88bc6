#include <gtest/gtest.h>
#include <libdeflate.h>
#include <png.h>

#include <array>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stages/base/images/image_codecs.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using testing::gradient_image;
using testing::opencv_read;
using testing::read_file;
using testing::same_pixels;
using testing::TemporaryFolder;
using testing::with_open;
using testing::write_file;

std::string why_png_refused(const std::filesystem::path& file) {
  return testing::why_refused(file, decode_png);
}

/// Writes what OpenCV cannot: any kind of PNG with pixels of `bits` bits and any filter of its
/// rows, whose bytes count up.
void write_png(const std::filesystem::path& path, ImageSize size, int kind, int bits, int interlace,
               bool pixels = true, int filters = PNG_ALL_FILTERS) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, size.width, size.height, bits, kind, interlace,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, filters);
  const std::array<png_color, 4> palette{{{1, 2, 3}, {40, 50, 60}, {200, 100, 0}, {255, 254, 253}}};
  const std::array<png_byte, 2> transparent{0, 128};
  if (kind == PNG_COLOR_TYPE_PALETTE) {
    png_set_PLTE(png, info, palette.data(), palette.size());
    png_set_tRNS(png, info, transparent.data(), transparent.size(), nullptr);
  }
  png_set_check_for_invalid_index(png, -1);  // let pixels be colours that the palette lacks
  png_write_info(png, info);
  if (pixels) {
    std::vector<std::vector<png_byte>> rows(size.height);
    std::vector<png_bytep> pointers;
    png_byte value = 0;
    for (auto& row : rows) {
      row.resize(png_get_rowbytes(png, info));
      for (png_byte& byte : row) byte = value += 37;
      pointers.push_back(row.data());
    }
    png_write_image(png, pointers.data());
    png_write_end(png, nullptr);
  }
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

struct PngKind {
  const char* name;
  int kind;
  int bits;
  int interlace;
};

class PngKinds : public ::testing::TestWithParam<PngKind> {};

TEST_P(PngKinds, DecodesToTheSamePixelsAsOpenCv) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  for (const ImageSize size : {ImageSize{11, 13}, ImageSize{1, 1}, ImageSize{3, 1}}) {
    for (const int filter : {PNG_FILTER_NONE, PNG_FILTER_SUB, PNG_FILTER_UP, PNG_FILTER_AVG,
                             PNG_FILTER_PAETH, PNG_ALL_FILTERS}) {
      write_png(file, size, GetParam().kind, GetParam().bits, GetParam().interlace, true, filter);
      EXPECT_TRUE(same_pixels(with_open(file, decode_png), opencv_read(file))) << filter;
      EXPECT_EQ(with_open(file, png_size), size);
      const auto whole = with_open(file, whole_png);
      const bool is_left = GetParam().bits < 8 || GetParam().interlace != 0;
      EXPECT_EQ(whole.has_value(), !is_left);
      if (whole) {
        EXPECT_EQ(std::pair(whole->size, whole->bits), std::pair(size, GetParam().bits));
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, PngKinds,
                         ::testing::Values(PngKind{"colour", PNG_COLOR_TYPE_RGB, 8, 0},
                                           PngKind{"colour_16_bit", PNG_COLOR_TYPE_RGB, 16, 0},
                                           PngKind{"transparent", PNG_COLOR_TYPE_RGBA, 8, 0},
                                           PngKind{"transparent_16", PNG_COLOR_TYPE_RGBA, 16, 0},
                                           PngKind{"grey", PNG_COLOR_TYPE_GRAY, 8, 0},
                                           PngKind{"grey_1_bit", PNG_COLOR_TYPE_GRAY, 1, 0},
                                           PngKind{"grey_16_bit", PNG_COLOR_TYPE_GRAY, 16, 0},
                                           PngKind{"grey_alpha", PNG_COLOR_TYPE_GRAY_ALPHA, 8, 0},
                                           PngKind{"grey_alpha_16", PNG_COLOR_TYPE_GRAY_ALPHA, 16,
                                                   0},
                                           PngKind{"palette", PNG_COLOR_TYPE_PALETTE, 2, 0},
                                           PngKind{"interlaced", PNG_COLOR_TYPE_RGB, 8, 1}),
                         [](const auto& param) { return param.param.name; });

TEST(PngImage, EveryTruncationIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  cv::imwrite(file.string(), gradient_image({64, 96}));
  const std::string bytes = read_file(file);
  // The last 12 bytes are the chunk IEND: without it all pixels are there, the file is not whole.
  for (std::size_t length = bytes.size() - 1; length > 8; length = length * 9 / 10) {
    write_file(file, bytes.substr(0, length));
    EXPECT_NE(why_png_refused(file), "") << length << " of " << bytes.size() << " bytes";
  }
}

TEST(PngImage, AnyChangedByteOfThePixelDataIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  cv::imwrite(file.string(), gradient_image({16, 24}));
  const std::string bytes = read_file(file);
  const std::size_t data = bytes.find("IDAT") + 4;
  for (std::size_t at = data; at < bytes.size() - 16; at += 7) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 0x10);
    write_file(file, changed);
    EXPECT_NE(why_png_refused(file), "") << "byte " << at;
  }
}

TEST(PngImage, AnIndexBeyondThePaletteIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  // Pixels count up by 37, so that they reach any number; the palette has four colours.
  for (const int interlace : {0, 1}) {
    for (const int bits : {4, 8}) {
      write_png(file, {11, 13}, PNG_COLOR_TYPE_PALETTE, bits, interlace);
      EXPECT_NE(why_png_refused(file), "") << bits << " bits";
    }
    write_png(file, {11, 13}, PNG_COLOR_TYPE_PALETTE, 2, interlace);
    EXPECT_TRUE(same_pixels(with_open(file, decode_png), opencv_read(file)));
  }
}

TEST(PngImage, IndicesAreAsTheyAreStored) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  const PngKind kinds[] = {
      {"grey", PNG_COLOR_TYPE_GRAY, 1, 0},      {"grey", PNG_COLOR_TYPE_GRAY, 4, 1},
      {"grey", PNG_COLOR_TYPE_GRAY, 8, 0},      {"grey", PNG_COLOR_TYPE_GRAY, 16, 0},
      {"grey", PNG_COLOR_TYPE_GRAY, 16, 1},     {"palette", PNG_COLOR_TYPE_PALETTE, 2, 0},
      {"palette", PNG_COLOR_TYPE_PALETTE, 8, 1}};
  constexpr ImageSize kSize{5, 13};
  for (const PngKind& kind : kinds) {
    write_png(file, kSize, kind.kind, kind.bits, kind.interlace);
    const IndexImage read = with_open(file, decode_index_png);
    EXPECT_EQ(read.size, kSize);
    EXPECT_EQ(read.bits, kind.bits);
    EXPECT_EQ(read.has_palette, kind.kind == PNG_COLOR_TYPE_PALETTE);
    ASSERT_EQ(read.indices.size(), 65u);
    const int row_bytes = (13 * kind.bits + 7) / 8;
    const auto byte = [&](int y, int at) { return 37 * (y * row_bytes + at + 1) % 256; };
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 13; ++x) {
        const int bit = x * kind.bits;
        const int expected = kind.bits == 16 ? 256 * byte(y, 2 * x) + byte(y, 2 * x + 1)
                                             : byte(y, bit / 8) >> (8 - kind.bits - bit % 8) &
                                                   ((1 << kind.bits) - 1);
        EXPECT_EQ(read.indices[static_cast<std::size_t>(13 * y + x)], expected)
            << kind.name << kind.bits << ": " << x << ", " << y;
      }
    }
  }
  write_png(file, kSize, PNG_COLOR_TYPE_RGB, 8, 0);
  EXPECT_EQ(testing::why_refused(file, decode_index_png),
            "colours, which are neither grey nor a palette's");
  write_png(file, kSize, PNG_COLOR_TYPE_GRAY, 8, 0);
  const std::string bytes = read_file(file);
  write_file(file, bytes.substr(0, bytes.size() - 20));
  EXPECT_NE(testing::why_refused(file, decode_index_png), "");
}

TEST(PngImage, DamageBesideThePixelsIsForgiven) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  cv::imwrite(file.string(), gradient_image({16, 24}));
  const cv::Mat whole = opencv_read(file);
  std::string bytes = read_file(file);
  // A chunk tEXt of 4 bytes whose checksum is wrong, after the signature (8) and IHDR (25).
  using namespace std::string_literals;
  bytes.insert(33, "\0\0\0\x04tEXta\0b!\0\0\0\0"s);
  write_file(file, bytes);
  EXPECT_TRUE(same_pixels(with_open(file, decode_png), whole));
}

TEST(PngImage, HugeAnnouncedSizeIsRefusedByName) {
  const TemporaryFolder folder;
  const auto file = folder / "image.png";
  write_png(file, {90000, 100000}, PNG_COLOR_TYPE_RGB, 8, 0, /*pixels=*/false);
  // Room for the start of the pixel data, so that the header counts as read.
  write_file(file, read_file(file) + std::string("\0\0\1\0IDAT", 8));
  EXPECT_NE(why_png_refused(file).find("100000x90000"), std::string::npos) << why_png_refused(file);
}

TEST(PngImage, RealFramesEqualOpenCv) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto kitti = data / "kitti_object/training";
  for (const auto& file : {kitti / "image_2/000000.png", kitti / "prev_2/001497_02.png",
                           data / "davis/slider_depth/images/frame_00000000.png"}) {
    EXPECT_TRUE(same_pixels(with_open(file, decode_png), opencv_read(file))) << file;
  }
}

class WholePngTest : public ::testing::Test {
 protected:
  std::string write(const cv::Mat& image) {
    cv::imwrite(file_.string(), image);
    return read_file(file_);
  }
  bool is_taken() const { return testing::with_open(file_, whole_png).has_value(); }
  bool is_taken(const std::string& bytes) const {
    write_file(file_, bytes);
    return is_taken();
  }

  const TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "image.png";
};

std::uint32_t number_at(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (int i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes.at(at + i));
  return value;
}

/// A chunk with its checksum.
std::string chunk(const std::string& type, const std::string& data) {
  const auto text = [](std::size_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  const std::string body = type + data;
  return text(data.size()) + body + text(libdeflate_crc32(0, body.data(), body.size()));
}

TEST_F(WholePngTest, HasThePixelsAsTheyAreStored) {
  const cv::Mat image = gradient_image({5, 11});
  write(image);
  auto pixels = testing::with_open(file_, whole_png);
  ASSERT_TRUE(pixels);
  EXPECT_EQ(pixels->size, (ImageSize{5, 11}));
  EXPECT_EQ(std::pair(pixels->samples, pixels->bits), std::pair(3, 8));
  EXPECT_FALSE(pixels->has_palette);
  for (int y = 0; y < 5; ++y) {
    ASSERT_EQ(pixels->row(y).size(), 33u);
    for (int x = 0; x < 11; ++x) {
      const auto& bgr = image.at<cv::Vec3b>(y, x);
      for (int k = 0; k < 3; ++k) ASSERT_EQ(pixels->row(y)[3 * x + k], bgr[2 - k]);
    }
  }
}

TEST_F(WholePngTest, OnlyWhatDecidesThePixelsCounts) {
  const cv::Mat image = gradient_image({16, 24});
  std::string bytes = write(image);
  const std::string early = chunk("tEXt", std::string("a\0b", 3));
  std::string late = chunk("tIME", std::string("\7\xd0\1\1\0\0\0", 7));
  late.back() ^= 1;                                     // a wrong checksum
  const std::string palette = chunk("PLTE", "rgbRGB");  // which colour images may suggest
  bytes.insert(33, early + palette);                    // after the signature (8) and IHDR (25)
  bytes.insert(bytes.size() - 12, late);
  EXPECT_TRUE(is_taken(bytes + "behind the end"));
  EXPECT_TRUE(same_pixels(testing::with_open(file_, decode_png), image));
}

TEST_F(WholePngTest, DataInManyChunksIsJoined) {
  const cv::Mat image = gradient_image({16, 24});
  const std::string bytes = write(image);
  const std::size_t at = bytes.find("IDAT");
  const std::string data = bytes.substr(at + 4, number_at(bytes, at - 4));
  std::string pieces = chunk("IDAT", "");
  for (std::size_t i = 0; i < data.size(); i += 10) pieces += chunk("IDAT", data.substr(i, 10));
  EXPECT_TRUE(is_taken(bytes.substr(0, at - 4) + pieces + chunk("IEND", "")));
  EXPECT_TRUE(same_pixels(testing::with_open(file_, decode_png), image));

  // In two runs it is against the standard: left to libpng.
  const std::string apart = bytes.substr(0, at - 4) + chunk("IDAT", data.substr(0, 10)) +
                            chunk("tEXt", std::string("a\0b", 3)) + chunk("IDAT", data.substr(10)) +
                            chunk("IEND", "");
  EXPECT_FALSE(is_taken(apart));
}

/// A zlib stream of the rows' bytes.
std::string zlib_stream(const std::string& rows) {
  libdeflate_compressor* const compressor = libdeflate_alloc_compressor(6);
  std::string stream(libdeflate_zlib_compress_bound(compressor, rows.size()), ' ');
  stream.resize(
      libdeflate_zlib_compress(compressor, rows.data(), rows.size(), stream.data(), stream.size()));
  libdeflate_free_compressor(compressor);
  return stream;
}

TEST_F(WholePngTest, AnyDoubtLeavesTheFileToLibpng) {
  const std::string bytes = write(gradient_image({16, 24}));
  const std::size_t at = bytes.find("IDAT");
  const std::string before = bytes.substr(0, at - 4);
  const std::string data = bytes.substr(at + 4, number_at(bytes, at - 4));
  const std::string pixels = chunk("IDAT", data);
  const std::string end = chunk("IEND", "");
  ASSERT_TRUE(is_taken(before + pixels + end));

  EXPECT_FALSE(is_taken(before + chunk("IDAT", data + "x") + end)) << "more data than pixels";
  EXPECT_FALSE(is_taken(before + chunk("IDAT", data.substr(0, data.size() - 1)) + end)) << "less";
  EXPECT_FALSE(is_taken(before + chunk("IDAT", "") + end)) << "none";
  EXPECT_FALSE(is_taken(before + end)) << "no chunk of it";
  EXPECT_FALSE(is_taken(before + chunk("ABCD", "") + pixels + end)) << "what may decide pixels";
  EXPECT_FALSE(is_taken(before + pixels + chunk("PLTE", "rgb") + end)) << "a late palette";
  EXPECT_FALSE(is_taken(before + chunk("PLTE", "rg") + pixels + end)) << "a part of a colour";
  EXPECT_FALSE(is_taken(bytes.substr(0, 8) + pixels + end)) << "no header";
  EXPECT_FALSE(is_taken(""));
  for (const auto& [byte, bit] : {std::pair{0, 1}, {0, 128}, {1, 1}, {1, 32}, {2, 2}}) {
    std::string changed = data;
    changed[byte] = static_cast<char>(changed[byte] ^ bit);
    EXPECT_FALSE(is_taken(before + chunk("IDAT", changed) + end)) << "zlib's byte " << byte;
  }
  std::string changed = data;
  changed.back() = static_cast<char>(changed.back() ^ 1);
  EXPECT_FALSE(is_taken(before + chunk("IDAT", changed) + end)) << "Adler-32 wrong, CRC-32 right";
  for (const std::size_t header_byte : {16, 20, 24, 25, 26, 27, 28, 29}) {
    std::string damaged = bytes;  // sizes, bits, kind, methods, checksum
    damaged[header_byte] = static_cast<char>(damaged[header_byte] ^ 4);
    EXPECT_FALSE(is_taken(damaged)) << header_byte;
    const std::string header = damaged.substr(16, 13);
    if (header_byte == 29) continue;
    EXPECT_FALSE(is_taken(bytes.substr(0, 8) + chunk("IHDR", header) + damaged.substr(33)))
        << header_byte;
  }
  for (std::size_t length = 0; length < bytes.size(); length += 5) {
    EXPECT_FALSE(is_taken(bytes.substr(0, length))) << length;
  }
}

TEST_F(WholePngTest, RowsHaveOneOfFiveFilters) {
  // Two rows of two grey pixels. Those of the first become 1, 3, as the one above it is 0; under it
  // 10 + (0 + 1) / 2, then 10 + (10 + 3) / 2.
  const std::string header("\0\0\0\2\0\0\0\2\x08\0\0\0\0", 13);
  const auto with = [&](const std::string& rows) {
    return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", zlib_stream(rows)) +
           chunk("IEND", "");
  };
  ASSERT_TRUE(is_taken(with("\1\1\2\3\x0a\x0a")));
  auto pixels = testing::with_open(file_, whole_png);
  EXPECT_EQ(std::vector(pixels->row(0).begin(), pixels->row(0).end()),
            (std::vector<std::uint8_t>{1, 3}));
  EXPECT_EQ(std::vector(pixels->row(1).begin(), pixels->row(1).end()),
            (std::vector<std::uint8_t>{10, 16}));
  EXPECT_FALSE(is_taken(with("\1\1\2\5\x0a\x0a"))) << "no such filter";
  EXPECT_NE(why_png_refused(file_), "");
}

TEST_F(WholePngTest, LibpngJudgesASecondHeaderAsItDoesInTheFile) {
  const std::string bytes = write(gradient_image({16, 24}));
  const std::string header = bytes.substr(8, 25);
  std::string twice = bytes;
  twice.insert(33, header);
  write_file(file_, twice);
  EXPECT_NE(testing::why_refused(file_, decode_png), "");
  write_file(file_, bytes.substr(0, bytes.size() - 12) + header + chunk("IEND", ""));
  EXPECT_NE(testing::why_refused(file_, decode_png), "");
}

TEST_F(WholePngTest, AnAnnouncedSizeThatTheDataCannotFillTakesNoMemory) {
  const std::string bytes = write(gradient_image({16, 24}));
  // 8000x8000 is within the limit, but a few hundred bytes cannot hold it.
  const std::string header("\0\0\x1f\x40\0\0\x1f\x40\x08\2\0\0\0", 13);
  EXPECT_FALSE(is_taken(bytes.substr(0, 8) + chunk("IHDR", header) + bytes.substr(33)));
}

}  // namespace
}  // namespace eventgan
