#include "stages/base/images/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "stages/base/images/image_codecs.h"

namespace eventgan {

void check_image_size(ImageSize size) {
  if (size.height > 0 && size.width > 0 && size.pixel_count() <= kMaxImagePixels) return;
  throw std::runtime_error("a size of " + to_string(size) + ", not 1 to " +
                           std::to_string(kMaxImagePixels) + " pixels");
}

namespace {

struct Format {
  const char* name;
  bool (*starts)(std::string_view bytes);  ///< a file of it, by the first 12
  ColourFrame (*decode)(std::FILE*);
  ImageSize (*size)(std::FILE*);
  int (*orientation)(std::FILE*);  ///< null: it tells none
};

constexpr std::array<Format, 6> kFormats = {{
    {"JPEG", [](std::string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }, decode_jpeg,
     jpeg_size, jpeg_orientation},
    {"PNG", [](std::string_view bytes) { return bytes.starts_with("\x89PNG\r\n\x1a\n"); },
     decode_png, png_size, png_orientation},
    {"WebP",
     [](std::string_view bytes) { return bytes.starts_with("RIFF") && bytes.ends_with("WEBP"); },
     decode_webp, webp_size, webp_orientation},
    {"TIFF",
     [](std::string_view bytes) {
       using namespace std::string_view_literals;
       return bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv) ||
              bytes.starts_with("II+\0"sv) || bytes.starts_with("MM\0+"sv);
     },
     decode_tiff, tiff_size, tiff_orientation},
    {"BMP", [](std::string_view bytes) { return bytes.starts_with("BM"); }, decode_bmp, bmp_size,
     nullptr},
    {"PNM",
     [](std::string_view bytes) {
       return bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
              std::isspace(static_cast<unsigned char>(bytes[2])) != 0;
     },
     decode_pnm, pnm_size, nullptr},
}};

/// None: the file is no image.
const Format* format_of(const InputFile& file) {
  std::array<char, 12> start;
  const std::size_t length = file.read_some(0, start);
  if (length == 0) throw std::runtime_error("expected an image, got an empty file");
  const auto* const format = std::ranges::find_if(kFormats, [&](const Format& one) {
    return one.starts(std::string_view(start.data(), length));
  });
  return format == kFormats.end() ? nullptr : format;
}

/// What one of a format's functions makes of the file, turned as is wanted; with its errors
/// completed.
template <class Result>
Result read_by_format(const InputFile& file, Result (*Format::*read)(std::FILE*),
                      ImageOrientation wanted, std::size_t block_bytes) {
  const Format* const format = format_of(file);
  if (format == nullptr) {
    throw std::runtime_error(
        "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM), got a file of another kind");
  }
  const InputFile::Stream stream = file.stream(block_bytes);
  int orientation = 1;
  Result result;
  try {
    if (wanted == ImageOrientation::kUpright && format->orientation != nullptr) {
      orientation = format->orientation(stream.get());
      std::rewind(stream.get());
    }
    result = (format->*read)(stream.get());
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(std::string("expected a whole ") + format->name + ", got " +
                             error.what());
  }
  if (orientation == 2 || orientation == 4 || orientation == 5 || orientation == 7) {
    throw std::runtime_error("expected an image that is not mirrored, got EXIF orientation " +
                             std::to_string(orientation));
  }
  return turned(std::move(result), orientation);
}

}  // namespace

Buffer whole_file(std::FILE* file, std::size_t most) {
  if (std::fseek(file, 0, SEEK_END) != 0) return {};
  const long end = std::ftell(file);
  std::rewind(file);
  if (end < 0 || static_cast<std::size_t>(end) > most) return {};
  Buffer bytes(static_cast<std::size_t>(end));
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file));
  return bytes;
}

InputFile open_image_file(const std::filesystem::path& file) {
  std::string reason;
  if (auto opened = InputFile::open(file, reason)) return *std::move(opened);
  throw std::runtime_error("expected a readable file, got '" + reason + "'");
}

bool is_image(const InputFile& file) { return format_of(file) != nullptr; }

ColourFrame decode_image(const InputFile& file, ImageOrientation orientation) {
  return read_by_format(file, &Format::decode, orientation, std::size_t{1} << 16);
}

ColourFrame decode_image_file(const std::filesystem::path& file, ImageOrientation orientation) {
  return decode_image(open_image_file(file), orientation);
}

ImageSize image_size(const InputFile& file, ImageOrientation orientation) {
  return read_by_format(file, &Format::size, orientation, std::size_t{1} << 13);
}

ImageSize image_file_size(const std::filesystem::path& file, ImageOrientation orientation) {
  return image_size(open_image_file(file), orientation);
}

}  // namespace eventgan
