// How images are to be turned.

#include <libdeflate.h>
#include <libexif/exif-data.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "stages/base/images/image_codecs.h"

namespace eventgan {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view kExif = "Exif\0\0"sv;
constexpr std::uint32_t kMostExifBytes = 1 << 24;  // a JPEG has no room for more than 64 KiB

/// With the name that is JPEG's alone, but that some write into PNG and WebP too.
Buffer named(Buffer block) {
  const bool is_named =
      block.size() >= kExif.size() &&
      std::ranges::equal(
          kExif, std::string_view(reinterpret_cast<const char*>(block.data()), kExif.size()));
  if (!is_named) block.insert(block.begin(), kExif.begin(), kExif.end());
  return block;
}

/// So many bytes of EXIF, from where the file is open at.
Buffer exif_block(std::FILE* file, std::uint32_t size_bytes) {
  if (size_bytes > kMostExifBytes) throw std::runtime_error("more than 16 MiB of EXIF");
  Buffer block(size_bytes);
  if (std::fread(block.data(), 1, block.size(), file) != block.size()) {
    throw std::runtime_error("one that ends early");
  }
  return named(std::move(block));
}

std::uint32_t png_number(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 |
         std::uint32_t{bytes[2]} << 8 | std::uint32_t{bytes[3]};
}

std::uint32_t riff_number(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[3]} << 24 | std::uint32_t{bytes[2]} << 16 |
         std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[0]};
}

}  // namespace

int exif_orientation(const Buffer& block) {
  const std::unique_ptr<ExifData, decltype(&exif_data_unref)> data(exif_data_new(),
                                                                   &exif_data_unref);
  if (data == nullptr) throw std::runtime_error("cannot start libexif");
  exif_data_unset_option(data.get(), EXIF_DATA_OPTION_FOLLOW_SPECIFICATION);  // as it is written
  exif_data_load_data(data.get(), block.data(), static_cast<unsigned int>(block.size()));
  const ExifEntry* const entry =
      exif_content_get_entry(data->ifd[EXIF_IFD_0], EXIF_TAG_ORIENTATION);
  if (entry == nullptr || entry->format != EXIF_FORMAT_SHORT || entry->size < 2) return 1;
  const int orientation = exif_get_short(entry->data, exif_data_get_byte_order(data.get()));
  return orientation >= 1 && orientation <= 8 ? orientation : 1;
}

// Every chunk of a PNG: length and type, as many bytes, a checksum of type and bytes. It is
// compared in every chunk but the pixels', whose decoder does: a damaged type would hide the
// orientation.
int png_orientation(std::FILE* file) {
  std::array<std::uint8_t, 8> head;
  std::fseek(file, head.size(), SEEK_SET);  // the signature
  while (std::fread(head.data(), 1, head.size(), file) == head.size()) {
    const std::uint32_t length = png_number(head.data());
    const std::string_view type(reinterpret_cast<const char*>(head.data()) + 4, 4);
    if (type == "IDAT") {
      if (std::fseek(file, static_cast<long>(length) + 4, SEEK_CUR) != 0) break;
      continue;
    }
    if (length > kMostExifBytes) throw std::runtime_error("more than 16 MiB of metadata");
    Buffer chunk(std::size_t{length} + 4);
    if (std::fread(chunk.data(), 1, chunk.size(), file) != chunk.size()) {
      throw std::runtime_error("one that ends early");
    }
    const std::uint32_t start = libdeflate_crc32(0, head.data() + 4, 4);
    if (libdeflate_crc32(start, chunk.data(), length) != png_number(chunk.data() + length)) {
      throw std::runtime_error(type == "eXIf" ? "damaged EXIF" : "a damaged chunk of metadata");
    }
    chunk.resize(length);
    if (type == "eXIf") return exif_orientation(named(std::move(chunk)));
    if (type == "IEND") break;
  }
  return 1;
}

// RIFF: behind "RIFF", a size and "WEBP", chunks of type and length, padded to an even one.
int webp_orientation(std::FILE* file) {
  std::array<std::uint8_t, 8> head{};
  std::fseek(file, 0, SEEK_END);
  const long file_size = std::ftell(file);
  std::rewind(file);
  const std::size_t read = std::fread(head.data(), 1, head.size(), file);
  // EXIF stands behind the pixels: of a file that ends early these may be whole.
  if (read < head.size() || file_size < 8 + static_cast<long>(riff_number(head.data() + 4))) {
    throw std::runtime_error("one that ends early or is damaged");
  }
  std::fseek(file, 4, SEEK_CUR);
  while (std::fread(head.data(), 1, head.size(), file) == head.size()) {
    const std::uint32_t length = riff_number(head.data() + 4);
    const std::string_view type(reinterpret_cast<const char*>(head.data()), 4);
    if (type == "EXIF") return exif_orientation(exif_block(file, length));
    if (std::fseek(file, static_cast<long>(length) + length % 2, SEEK_CUR) != 0) break;
  }
  return 1;
}

ImageSize turned(ImageSize stored, int orientation) {
  const bool lies = orientation == 6 || orientation == 8;
  return lies ? ImageSize{stored.width, stored.height} : stored;
}

ColourFrame turned(ColourFrame stored, int orientation) {
  if (orientation == 1) return stored;
  const auto [height, width] = stored.size;
  ColourFrame upright{turned(stored.size, orientation), {}};
  upright.bgr.resize(stored.bgr.size());
  std::uint8_t* to = upright.bgr.data();
  for (int y = 0; y < upright.size.height; ++y) {
    for (int x = 0; x < upright.size.width; ++x) {
      const int row = orientation == 8 ? x : height - 1 - (orientation == 6 ? x : y);
      const int column = orientation == 6 ? y : width - 1 - (orientation == 8 ? y : x);
      const std::size_t pixel = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                                static_cast<std::size_t>(column);
      to = std::copy_n(stored.bgr.data() + 3 * pixel, 3, to);
    }
  }
  return upright;
}

}  // namespace eventgan
