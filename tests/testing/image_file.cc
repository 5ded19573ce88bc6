#include "tests/testing/image_file.h"

#include <png.h>

#include <array>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace eventgan::testing {

void write_flat_image(const std::filesystem::path& path, ImageSize size, int value) {
  std::filesystem::create_directories(path.parent_path());
  const cv::Mat image(size.height, size.width, CV_8UC1, cv::Scalar(value));
  if (!cv::imwrite(path.string(), image)) throw std::runtime_error("cannot write " + path.string());
}

void write_index_image(const std::filesystem::path& path, ImageSize size,
                       const std::vector<int>& indices, IndexPng kind) {
  std::filesystem::create_directories(path.parent_path());
  if (indices.size() != size.pixel_count()) throw std::runtime_error("another number of indices");
  const cv::Mat whole(size.height, size.width, CV_32SC1, const_cast<int*>(indices.data()));
  cv::Mat image;
  whole.convertTo(image, kind == IndexPng::kGrey16 ? CV_16U : CV_8U);
  if (kind != IndexPng::kPalette) {
    if (!cv::imwrite(path.string(), image))
      throw std::runtime_error("cannot write " + path.string());
    return;
  }
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) throw std::runtime_error("cannot write " + path.string());
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, static_cast<png_uint_32>(size.width),
               static_cast<png_uint_32>(size.height), 8, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  std::array<png_color, 256> palette;
  for (std::size_t i = 0; i < palette.size(); ++i) {
    palette[i] = {static_cast<png_byte>(128 * (i % 2)), static_cast<png_byte>(77 * i), 9};
  }
  png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
  png_write_info(png, info);
  for (int y = 0; y < size.height; ++y) png_write_row(png, image.ptr(y));
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

}  // namespace eventgan::testing
