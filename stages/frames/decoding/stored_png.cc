#include "stages/frames/decoding/stored_png.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "stages/frames/decoding/picture_limits.h"

namespace eventgan {
namespace {

using Bytes = std::span<const std::uint8_t>;
using Buffer = std::vector<std::uint8_t>;

constexpr std::size_t kSignatureBytes = 8;
constexpr std::size_t kAroundData = 12;         // of a chunk: length, type, checksum
constexpr std::size_t kMostInMemory = 1 << 28;  // beyond, libpng reads piece by piece
constexpr std::size_t kLargestStored = 0xffff;  // bytes of one stored block
constexpr std::size_t kMostPerByte = 1032;      // deflate cannot shrink further

std::uint32_t big_endian(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 |
         std::uint32_t{bytes[2]} << 8 | std::uint32_t{bytes[3]};
}

void put_big_endian(std::uint32_t value, std::uint8_t* bytes) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(value >> (24 - 8 * i));
}

/// Empty if it cannot be read, or is too large.
Buffer whole_file(std::FILE* file) {
  if (std::fseek(file, 0, SEEK_END) != 0) return {};
  const long end = std::ftell(file);
  std::rewind(file);
  if (end < 0 || static_cast<std::size_t>(end) > kMostInMemory) return {};
  Buffer bytes(static_cast<std::size_t>(end));
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file));
  return bytes;
}

struct Chunk {
  std::string_view type;
  Bytes data;
  Bytes whole;  ///< with length, type and checksum

  bool checksum_fits() const {
    return libdeflate_crc32(0, whole.data() + 4, data.size() + 4) ==
           big_endian(data.data() + data.size());
  }
};

/// The chunk at the start of `rest`, if it is all there.
std::optional<Chunk> first_chunk(Bytes rest) {
  if (rest.size() < kAroundData) return std::nullopt;
  const std::size_t length = big_endian(rest.data());
  if (length > rest.size() - kAroundData) return std::nullopt;
  return Chunk{{reinterpret_cast<const char*>(rest.data()) + 4, 4},
               rest.subspan(8, length),
               rest.first(length + kAroundData)};
}

/// What a sound header says of the size of the pixel data: each row has a byte in front that names
/// its filter.
std::optional<std::size_t> pixel_data_bytes(const Chunk& header) {
  if (header.type != "IHDR" || header.data.size() != 13 || !header.checksum_fits()) return {};
  const std::size_t width = big_endian(header.data.data());
  const std::size_t height = big_endian(header.data.data() + 4);
  const std::uint8_t bits = header.data[8];
  const std::uint8_t kind = header.data[9];
  constexpr std::array<std::uint8_t, 7> kChannels{1, 0, 3, 1, 2, 0, 4};
  const bool interlaced = header.data[12] != 0;
  if (width == 0 || height == 0 || width > kMaxPicturePixels || height > kMaxPicturePixels ||
      width * height > kMaxPicturePixels || bits > 16 || kind >= kChannels.size() || interlaced) {
    return {};
  }
  return height * (1 + (width * kChannels[kind] * bits + 7) / 8);
}

/// A PNG taken apart. Empty if the chunks are not whole and in order.
struct Parts {
  Bytes before;  ///< up to the pixel data
  Buffer compressed;
  Bytes after;  ///< from the pixel data to the end
};

std::optional<Parts> take_apart(Bytes file) {
  Parts parts;
  std::size_t at = kSignatureBytes;
  std::size_t data_end = 0;
  while (const auto chunk = first_chunk(file.subspan(at))) {
    if (chunk->type == "IDAT") {
      if (data_end == 0) parts.before = file.first(at);
      if ((data_end != 0 && data_end != at) || !chunk->checksum_fits()) return {};
      parts.compressed.insert(parts.compressed.end(), chunk->data.begin(), chunk->data.end());
      data_end = at + chunk->whole.size();
    }
    at += chunk->whole.size();
    if (chunk->type != "IEND") continue;
    if (data_end == 0) return {};
    parts.after = file.subspan(data_end, at - data_end);
    return parts;
  }
  return {};
}

/// Whether no distance can reach beyond the window that the zlib header announces: zlib refuses
/// what does, libdeflate does not look at it.
bool window_reaches_all(Bytes compressed, std::size_t raw_bytes) {
  if (compressed.empty()) return false;
  constexpr std::size_t kFullWindow = 1 << 15;
  return std::size_t{1} << (8 + (compressed[0] >> 4)) >= std::min(raw_bytes, kFullWindow);
}

bool inflate(Bytes compressed, std::span<std::uint8_t> raw) {
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)>
      decompressor(libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  std::size_t used = 0;
  return decompressor != nullptr &&
         libdeflate_zlib_decompress_ex(decompressor.get(), compressed.data(), compressed.size(),
                                       raw.data(), raw.size(), &used,
                                       nullptr) == LIBDEFLATE_SUCCESS &&
         used == compressed.size();
}

/// The file put together again with one chunk of stored data, its zlib header announcing the full
/// window. Empty if the data is not sound, or not `raw_bytes` when inflated.
Buffer with_stored_data(const Parts& parts, std::size_t raw_bytes) {
  // chunk length, type | zlib header | blocks: header of 5 bytes, data | Adler-32 | CRC-32
  const std::size_t blocks = (raw_bytes + kLargestStored - 1) / kLargestStored;
  const std::size_t data_bytes = 2 + 5 * blocks + raw_bytes + 4;
  Buffer stored(parts.before.size() + data_bytes + kAroundData + parts.after.size());
  std::ranges::copy(parts.before, stored.begin());
  std::uint8_t* const chunk = stored.data() + parts.before.size();
  put_big_endian(static_cast<std::uint32_t>(data_bytes), chunk);
  std::ranges::copy(std::string_view("IDAT\x78\x01"), chunk + 4);

  // Inflated behind the room for the blocks' headers, then moved forward block by block.
  std::uint8_t* to = chunk + 10;
  const std::span<std::uint8_t> raw(to + 5 * blocks, raw_bytes);
  if (!inflate(parts.compressed, raw)) return {};
  const std::uint32_t adler = libdeflate_adler32(1, raw.data(), raw.size());
  for (std::size_t at = 0; at < raw_bytes; at += kLargestStored) {
    const std::size_t size = std::min(raw_bytes - at, kLargestStored);
    *to++ = at + size == raw_bytes ? 1 : 0;  // the last block
    for (const std::size_t length : {size, ~size}) {
      *to++ = static_cast<std::uint8_t>(length);
      *to++ = static_cast<std::uint8_t>(length >> 8);
    }
    std::memmove(to, raw.data() + at, size);
    to += size;
  }
  put_big_endian(adler, to);
  put_big_endian(libdeflate_crc32(0, chunk + 4, 4 + data_bytes), to + 4);
  std::ranges::copy(parts.after, to + 8);
  return stored;
}

}  // namespace

std::vector<std::uint8_t> stored_png(std::FILE* stream) {
  const Buffer file = whole_file(stream);
  if (file.size() < kSignatureBytes) return {};
  const auto header = first_chunk(Bytes(file).subspan(kSignatureBytes));
  if (!header) return {};
  const auto raw_bytes = pixel_data_bytes(*header);
  if (!raw_bytes || *raw_bytes > std::min(kMostPerByte * file.size(), kMostInMemory)) return {};
  const auto parts = take_apart(file);
  if (!parts || !window_reaches_all(parts->compressed, *raw_bytes)) return {};
  return with_stored_data(*parts, *raw_bytes);
}

}  // namespace eventgan
