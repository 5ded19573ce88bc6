#include "stages/base/images/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
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
  int (*orientation)(std::FILE*);                ///< null: it tells none
  std::optional<WideFrame> (*wide)(std::FILE*);  ///< null: no more than 8 bits
};

constexpr std::array<Format, 6> kFormats = {{
    {"JPEG", [](std::string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }, decode_jpeg,
     jpeg_size, jpeg_orientation, nullptr},
    {"PNG", [](std::string_view bytes) { return bytes.starts_with("\x89PNG\r\n\x1a\n"); },
     decode_png, png_size, png_orientation, decode_wide_png},
    {"WebP",
     [](std::string_view bytes) { return bytes.starts_with("RIFF") && bytes.ends_with("WEBP"); },
     decode_webp, webp_size, webp_orientation, nullptr},
    {"TIFF",
     [](std::string_view bytes) {
       using namespace std::string_view_literals;
       return bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv) ||
              bytes.starts_with("II+\0"sv) || bytes.starts_with("MM\0+"sv);
     },
     decode_tiff, tiff_size, tiff_orientation, decode_wide_tiff},
    {"BMP", [](std::string_view bytes) { return bytes.starts_with("BM"); }, decode_bmp, bmp_size,
     nullptr, nullptr},
    {"PNM",
     [](std::string_view bytes) {
       return bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
              std::isspace(static_cast<unsigned char>(bytes[2])) != 0;
     },
     decode_pnm, pnm_size, nullptr, decode_wide_pnm},
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

/// What `read(format, stream)` makes of the file, turned as is wanted; with its errors
/// completed.
template <class Read>
auto read_by_format(const InputFile& file, const Read& read, ImageOrientation wanted,
                    std::size_t block_bytes) {
  const Format* const format = format_of(file);
  if (format == nullptr) {
    throw std::runtime_error(
        "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM), got a file of another kind");
  }
  const InputFile::Stream stream = file.stream(block_bytes);
  int orientation = 1;
  decltype(read(*format, stream.get())) result;
  try {
    if (wanted == ImageOrientation::kUpright && format->orientation != nullptr) {
      orientation = format->orientation(stream.get());
      std::rewind(stream.get());
    }
    result = read(*format, stream.get());
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

constexpr std::size_t kPixelsBlock = std::size_t{1} << 16;
constexpr std::size_t kHeaderBlock = std::size_t{1} << 13;

ColourFrame narrowed(const WideFrame& wide, const ValueRange& range) {
  std::vector<std::uint8_t> bytes(65536);  // of each value
  const double scale = 255.0 / (range.high - range.low);
  for (int value = 0; value < 65536; ++value) {
    bytes[static_cast<std::size_t>(value)] =
        static_cast<std::uint8_t>(std::lround(std::clamp((value - range.low) * scale, 0.0, 255.0)));
  }
  ColourFrame frame{wide.size, std::vector<std::uint8_t>(wide.bgr.size())};
  std::ranges::transform(wide.bgr, frame.bgr.begin(),
                         [&](std::uint16_t value) { return bytes[value]; });
  return frame;
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

ColourFrame decode_image(const InputFile& file, ImageOrientation orientation,
                         const std::optional<ValueRange>& range, int reduced_by) {
  const auto decode = [&](const Format& format, std::FILE* stream) {
    if (range && format.wide != nullptr) {
      if (const auto wide = format.wide(stream)) return narrowed(*wide, *range);
      std::rewind(stream);
    }
    return format.decode == decode_jpeg ? decode_reduced_jpeg(stream, reduced_by)
                                        : format.decode(stream);
  };
  return read_by_format(file, decode, orientation, kPixelsBlock);
}

ColourFrame decode_image_file(const std::filesystem::path& file, ImageOrientation orientation,
                              const std::optional<ValueRange>& range) {
  return decode_image(open_image_file(file), orientation, range);
}

namespace {

/// `what`: the kind of PNG that `decode` wants.
template <class Decode>
auto read_png(const InputFile& file, const char* what, Decode decode) {
  const Format* const format = format_of(file);
  if (format == nullptr || format->decode != decode_png) {
    throw std::runtime_error("expected a PNG, got a file of another kind");
  }
  const InputFile::Stream stream = file.stream(kPixelsBlock);
  try {
    return decode(stream.get());
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(std::string("expected a whole PNG of ") + what + ", got " +
                             error.what());
  }
}

}  // namespace

IndexImage decode_index_image(const InputFile& file) {
  return read_png(file, "indices", decode_index_png);
}

WideFrame decode_wide_image(const InputFile& file) {
  return read_png(file, "16 bits of red, green and blue", [&](std::FILE* stream) {
    constexpr std::uint64_t kKind = 25;  // in the header, after size and bits
    constexpr char kColours = 2;         // neither grey nor transparent
    const bool are_colours = file.size_bytes() > kKind && file.read(kKind, 1)[0] == kColours;
    auto wide = decode_wide_png(stream);
    if (wide && are_colours) return *std::move(wide);
    throw std::runtime_error(wide ? "another kind of pixels" : "fewer bits");
  });
}

bool count_wide_values(const InputFile& file, std::span<std::int64_t> histogram) {
  bool is_wide = false;
  const auto count = [&](const Format& format, std::FILE* stream) {
    const auto wide = format.wide == nullptr ? std::nullopt : format.wide(stream);
    if (!wide) return ImageSize{};
    is_wide = true;
    for (const std::uint16_t value : wide->bgr) ++histogram[value];
    return wide->size;
  };
  read_by_format(file, count, ImageOrientation::kStored, kPixelsBlock);
  return is_wide;
}

ImageSize image_size(const InputFile& file, ImageOrientation orientation) {
  const auto size = [](const Format& format, std::FILE* stream) { return format.size(stream); };
  return read_by_format(file, size, orientation, kHeaderBlock);
}

ImageSize image_file_size(const std::filesystem::path& file, ImageOrientation orientation) {
  return image_size(open_image_file(file), orientation);
}

}  // namespace eventgan
