#include "stages/base/images/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "stages/base/images/image_codecs.h"

namespace eventgan {

void check_image_size(ImageSize size) {
  if (size.height > 0 && size.width > 0 && size.pixel_count() <= kMaxImagePixels) return;
  throw std::runtime_error("a size of " + to_string(size) + ", not 1 to " +
                           std::to_string(kMaxImagePixels) + " pixels");
}

namespace {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using OpenFile = std::unique_ptr<std::FILE, FileCloser>;

OpenFile open_file(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw std::runtime_error("expected a file, got none");
  if (!std::filesystem::is_regular_file(status)) {
    throw std::runtime_error("expected a file, got a folder or device");
  }
  OpenFile file(std::fopen(path.c_str(), "rb"));
  if (file == nullptr) throw std::runtime_error("expected a readable file, got no permission");
  return file;
}

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

/// None: the file is no image. Leaves `file` at its start.
const Format* format_of(std::FILE* file) {
  std::array<char, 12> start{};
  const std::size_t length = std::fread(start.data(), 1, start.size(), file);
  if (length == 0) throw std::runtime_error("expected an image, got an empty file");
  std::rewind(file);
  const auto* const format = std::ranges::find_if(kFormats, [&](const Format& one) {
    return one.starts(std::string_view(start.data(), length));
  });
  return format == kFormats.end() ? nullptr : format;
}

/// What one of a format's functions makes of the file, turned as is wanted; with its errors
/// completed.
template <class Result>
Result read_by_format(const std::filesystem::path& path, Result (*Format::*read)(std::FILE*),
                      ImageOrientation wanted) {
  const OpenFile file = open_file(path);
  const Format* const format = format_of(file.get());
  if (format == nullptr) {
    throw std::runtime_error(
        "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM), got a file of another kind");
  }
  int orientation = 1;
  Result result;
  try {
    if (wanted == ImageOrientation::kUpright && format->orientation != nullptr) {
      orientation = format->orientation(file.get());
      std::rewind(file.get());
    }
    result = (format->*read)(file.get());
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

bool is_image_file(const std::filesystem::path& file) {
  return format_of(open_file(file).get()) != nullptr;
}

ColourFrame decode_image_file(const std::filesystem::path& file, ImageOrientation orientation) {
  return read_by_format(file, &Format::decode, orientation);
}

ImageSize image_file_size(const std::filesystem::path& file, ImageOrientation orientation) {
  return read_by_format(file, &Format::size, orientation);
}

}  // namespace eventgan
