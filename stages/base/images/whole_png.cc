#include <isa-l/igzip_lib.h>
#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "stages/base/images/image_codecs.h"
#include "stages/base/images/image_file.h"

namespace eventgan {
namespace {

constexpr std::size_t kSignatureBytes = 8;
constexpr std::size_t kAroundData = 12;          // of a chunk: length, type, checksum
constexpr std::size_t kMostInMemory = 1 << 28;   // beyond, libpng reads piece by piece
constexpr std::size_t kMostPerByte = 1032;       // deflate cannot shrink further
constexpr std::size_t kLongestSide = 1'000'000;  // libpng's limit

// Colour types, and how many samples a pixel has: grey, colours, palette, grey and colours with
// alpha.
constexpr std::uint8_t kPalette = 3;
constexpr std::array<int, 7> kSamples{1, 0, 3, 1, 2, 0, 4};

std::uint32_t big_endian(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 |
         std::uint32_t{bytes[2]} << 8 | std::uint32_t{bytes[3]};
}

/// What the 13 bytes of a header say, without pixels; nothing if they are left to libpng.
std::optional<PngPixels> read_header(const std::uint8_t* header) {
  const std::size_t width = big_endian(header);
  const std::size_t height = big_endian(header + 4);
  const std::uint8_t bits = header[8];
  const std::uint8_t kind = header[9];
  const bool is_usual = header[10] == 0 && header[11] == 0 && header[12] == 0;  // not interlaced
  if (!is_usual || std::min(width, height) == 0 || std::max(width, height) > kLongestSide ||
      width * height > kMaxImagePixels || kind >= kSamples.size() || kSamples[kind] == 0 ||
      (bits != 8 && (bits != 16 || kind == kPalette))) {
    return std::nullopt;
  }
  PngPixels pixels;
  pixels.size = {static_cast<int>(height), static_cast<int>(width)};
  pixels.samples = kSamples[kind];
  pixels.bits = bits;
  pixels.has_palette = kind == kPalette;
  return pixels;
}

/// Inflates a zlib stream into bytes of which it must have exactly as many; false if it is not
/// sound. ISA-L inflates photographs faster than libdeflate, but does not sum: its sum leaves the
/// upper halves of the vector registers in use.
bool inflate(std::span<const std::uint8_t> stream, std::span<std::uint8_t> bytes) {
  constexpr std::size_t kHeader = 2;
  constexpr std::size_t kSum = 4;
  if (stream.size() < kHeader + kSum) return false;
  const unsigned method = stream[0];
  const unsigned flags = stream[1];
  if ((method & 15) != 8 || method >> 4 > 7 || (flags & 32) != 0 || (256 * method + flags) % 31) {
    return false;
  }
  const auto state = std::make_unique_for_overwrite<inflate_state>();
  isal_inflate_init(state.get());
  state->crc_flag = ISAL_DEFLATE;
  state->next_in = const_cast<std::uint8_t*>(stream.data()) + kHeader;
  state->avail_in = static_cast<std::uint32_t>(stream.size() - kHeader);
  state->next_out = bytes.data();
  state->avail_out = static_cast<std::uint32_t>(bytes.size());
  return isal_inflate_stateless(state.get()) == ISAL_DECOMP_OK &&
         state->block_state == ISAL_BLOCK_FINISH && state->avail_out == 0 &&
         state->avail_in == kSum &&
         libdeflate_adler32(1, bytes.data(), bytes.size()) == big_endian(&stream.back() - 3);
}

/// PNG's predictor (section 9.4): the neighbour that is nearest to left + above - corner.
std::uint8_t paeth(int left, int above, int corner) {
  const int to_left = std::abs(above - corner);
  const int to_above = std::abs(left - corner);
  const int to_corner = std::abs(left + above - 2 * corner);
  const int nearer = to_left <= to_above ? left : above;
  return static_cast<std::uint8_t>(std::min(to_left, to_above) <= to_corner ? nearer : corner);
}

/// Adds to each byte of a row what `predict` makes of its left neighbour, a pixel before it, the
/// one above, and the one left of that, all of them done.
template <std::size_t kPixelBytes, class Predict>
void add_predictions(std::span<std::uint8_t> row, const std::uint8_t* above, Predict predict) {
  std::array<std::uint8_t, kPixelBytes> left{};
  std::array<std::uint8_t, kPixelBytes> corner{};
  for (std::size_t x = 0; x < row.size(); x += kPixelBytes) {
    for (std::size_t i = 0; i < kPixelBytes; ++i) {
      left[i] = static_cast<std::uint8_t>(row[x + i] + predict(left[i], above[x + i], corner[i]));
      corner[i] = above[x + i];
      row[x + i] = left[i];
    }
  }
}

/// Undoes a row's filter (section 9.2); false if there is no such filter.
template <std::size_t kPixelBytes>
bool undo_filter(std::uint8_t filter, std::span<std::uint8_t> row, const std::uint8_t* above) {
  switch (filter) {
    case 0:
      return true;
    case 1:
      add_predictions<kPixelBytes>(row, above, [](auto left, auto, auto) { return left; });
      return true;
    case 2:
      for (std::size_t i = 0; i < row.size(); ++i) row[i] += above[i];
      return true;
    case 3:
      add_predictions<kPixelBytes>(row, above, [](int a, int b, int) { return (a + b) / 2; });
      return true;
    case 4:
      add_predictions<kPixelBytes>(row, above, paeth);
      return true;
    default:
      return false;
  }
}

template <std::size_t kPixelBytes>
bool undo_filters(PngPixels& pixels) {
  const std::vector<std::uint8_t> none(pixels.row_bytes());
  const std::uint8_t* above = none.data();
  for (int y = 0; y < pixels.size.height; ++y) {
    const std::span<std::uint8_t> row = pixels.row(y);
    if (!undo_filter<kPixelBytes>(row.data()[-1], row, above)) return false;
    above = row.data();
  }
  return true;
}

bool undo_filters(PngPixels& pixels) {
  switch (pixels.pixel_bytes()) {
    case 1:
      return undo_filters<1>(pixels);
    case 2:
      return undo_filters<2>(pixels);
    case 3:
      return undo_filters<3>(pixels);
    case 4:
      return undo_filters<4>(pixels);
    case 6:
      return undo_filters<6>(pixels);
    default:
      return undo_filters<8>(pixels);
  }
}

}  // namespace

std::optional<PngPixels> whole_png(std::FILE* stream) {
  const Buffer file = whole_file(stream, kMostInMemory);
  std::optional<PngPixels> pixels;
  Buffer compressed;
  bool data_ended = false;
  for (std::size_t at = kSignatureBytes; file.size() >= at + kAroundData;) {
    const std::uint8_t* const chunk = file.data() + at;
    const std::size_t length = big_endian(chunk);
    if (length > file.size() - at - kAroundData) return {};
    const std::string_view type(reinterpret_cast<const char*>(chunk) + 4, 4);
    const std::span data(chunk + 8, length);
    at += length + kAroundData;
    if (type == "IDAT" && data_ended) return {};  // in two runs
    data_ended = type != "IDAT" && !compressed.empty();
    if ((type[0] & 0x20) != 0) continue;  // says nothing of the pixels
    if (libdeflate_crc32(0, chunk + 4, length + 4) != big_endian(data.data() + length)) return {};
    if (pixels.has_value() == (type == "IHDR")) return {};
    if (type == "IHDR") {
      if (length != 13 || !(pixels = read_header(data.data()))) return {};
    } else if (type == "IDAT") {
      if (compressed.empty()) compressed.reserve(file.size());
      compressed.insert(compressed.end(), data.begin(), data.end());
    } else if (type == "PLTE") {
      const bool is_fit = pixels->samples >= 3 || pixels->has_palette;
      if (!is_fit || !pixels->palette.empty() || !compressed.empty() || length == 0 ||
          length % 3 != 0 || length > 3 * 256) {
        return {};
      }
      pixels->palette.assign(data.begin(), data.end());
    } else if (type == "IEND") {
      const std::size_t bytes =
          static_cast<std::size_t>(pixels->size.height) * (1 + pixels->row_bytes());
      if (bytes > std::min(kMostPerByte * compressed.size(), kMostInMemory) ||
          (pixels->has_palette && pixels->palette.empty())) {
        return {};
      }
      pixels->rows.resize(bytes);
      if (!inflate(compressed, pixels->rows) || !undo_filters(*pixels)) return {};
      return pixels;
    } else {
      return {};
    }
  }
  return {};
}

}  // namespace eventgan
