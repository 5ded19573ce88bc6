#include "stages/frames/decoding/png_picture.h"

#include <gtest/gtest.h>
#include <png.h>

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/stages/frames/decoding/test_pictures.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using testing::gradient_picture;
using testing::opencv_read;
using testing::read_file;
using testing::same_pixels;
using testing::TemporaryFolder;
using testing::with_open;
using testing::write_file;

std::string why_refused(const std::filesystem::path& file) {
  return testing::why_refused(file, decode_png);
}

/// Writes what OpenCV cannot: any kind of PNG with pixels of `bits` bits, all rows counting up.
void write_png(const std::filesystem::path& path, ImageSize size, int kind, int bits, int interlace,
               bool pixels = true) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, size.width, size.height, bits, kind, interlace,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
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

struct Kind {
  const char* name;
  int kind;
  int bits;
  int interlace;
};

class PngKinds : public ::testing::TestWithParam<Kind> {};

TEST_P(PngKinds, DecodesToTheSamePixelsAsOpenCv) {
  const TemporaryFolder folder;
  const auto file = folder / "picture.png";
  for (const ImageSize size : {ImageSize{11, 13}, ImageSize{1, 1}}) {
    write_png(file, size, GetParam().kind, GetParam().bits, GetParam().interlace);
    EXPECT_TRUE(same_pixels(with_open(file, decode_png), opencv_read(file)));
    EXPECT_EQ(with_open(file, png_size), size);
  }
}

INSTANTIATE_TEST_SUITE_P(, PngKinds,
                         ::testing::Values(Kind{"colour", PNG_COLOR_TYPE_RGB, 8, 0},
                                           Kind{"colour_16_bit", PNG_COLOR_TYPE_RGB, 16, 0},
                                           Kind{"transparent", PNG_COLOR_TYPE_RGBA, 8, 0},
                                           Kind{"transparent_16", PNG_COLOR_TYPE_RGBA, 16, 0},
                                           Kind{"grey", PNG_COLOR_TYPE_GRAY, 8, 0},
                                           Kind{"grey_1_bit", PNG_COLOR_TYPE_GRAY, 1, 0},
                                           Kind{"grey_16_bit", PNG_COLOR_TYPE_GRAY, 16, 0},
                                           Kind{"grey_alpha", PNG_COLOR_TYPE_GRAY_ALPHA, 8, 0},
                                           Kind{"palette", PNG_COLOR_TYPE_PALETTE, 2, 0},
                                           Kind{"interlaced", PNG_COLOR_TYPE_RGB, 8, 1}),
                         [](const auto& param) { return param.param.name; });

TEST(PngPicture, EveryTruncationIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "picture.png";
  cv::imwrite(file.string(), gradient_picture({64, 96}));
  const std::string bytes = read_file(file);
  // The last 12 bytes are the chunk IEND: without it all pixels are there, the file is not whole.
  for (std::size_t length = bytes.size() - 1; length > 8; length = length * 9 / 10) {
    write_file(file, bytes.substr(0, length));
    EXPECT_NE(why_refused(file), "") << length << " of " << bytes.size() << " bytes";
  }
}

TEST(PngPicture, AnyChangedByteOfThePixelDataIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "picture.png";
  cv::imwrite(file.string(), gradient_picture({16, 24}));
  const std::string bytes = read_file(file);
  const std::size_t data = bytes.find("IDAT") + 4;
  for (std::size_t at = data; at < bytes.size() - 16; at += 7) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 0x10);
    write_file(file, changed);
    EXPECT_NE(why_refused(file), "") << "byte " << at;
  }
}

TEST(PngPicture, AnIndexBeyondThePaletteIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "picture.png";
  // Pixels count up by 37, so that they reach any number; the palette has four colours.
  for (const int interlace : {0, 1}) {
    for (const int bits : {4, 8}) {
      write_png(file, {11, 13}, PNG_COLOR_TYPE_PALETTE, bits, interlace);
      EXPECT_NE(why_refused(file), "") << bits << " bits";
    }
    write_png(file, {11, 13}, PNG_COLOR_TYPE_PALETTE, 2, interlace);
    EXPECT_TRUE(same_pixels(with_open(file, decode_png), opencv_read(file)));
  }
}

TEST(PngPicture, DamageBesideThePixelsIsForgiven) {
  const TemporaryFolder folder;
  const auto file = folder / "picture.png";
  cv::imwrite(file.string(), gradient_picture({16, 24}));
  const cv::Mat whole = opencv_read(file);
  std::string bytes = read_file(file);
  // A chunk tEXt of 4 bytes whose checksum is wrong, after the signature (8) and IHDR (25).
  using namespace std::string_literals;
  bytes.insert(33, "\0\0\0\x04tEXta\0b!\0\0\0\0"s);
  write_file(file, bytes);
  EXPECT_TRUE(same_pixels(with_open(file, decode_png), whole));
}

TEST(PngPicture, HugeAnnouncedSizeIsRefusedByName) {
  const TemporaryFolder folder;
  const auto file = folder / "picture.png";
  write_png(file, {90000, 100000}, PNG_COLOR_TYPE_RGB, 8, 0, /*pixels=*/false);
  // Room for the start of the pixel data, so that the header counts as read.
  write_file(file, read_file(file) + std::string("\0\0\1\0IDAT", 8));
  EXPECT_NE(why_refused(file).find("100000x90000"), std::string::npos) << why_refused(file);
}

TEST(PngPicture, RealFramesEqualOpenCv) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto kitti = data / "kitti_object/training";
  for (const auto& file : {kitti / "image_2/000000.png", kitti / "prev_2/001497_02.png",
                           data / "davis/slider_depth/images/frame_00000000.png"}) {
    EXPECT_TRUE(same_pixels(with_open(file, decode_png), opencv_read(file))) << file;
  }
}

}  // namespace
}  // namespace eventgan
