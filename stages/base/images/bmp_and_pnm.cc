#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/images/image_codecs.h"

namespace eventgan {
namespace {

void read_exactly(std::FILE* file, std::uint8_t* to, std::size_t count) {
  if (std::fread(to, 1, count, file) != count) throw std::runtime_error("one that ends early");
}

/// Throws if fewer bytes are left in the file: before memory is taken for what they say.
void require_bytes(std::FILE* file, std::size_t count) {
  const long here = std::ftell(file);
  std::fseek(file, 0, SEEK_END);
  const long end = std::ftell(file);
  if (here < 0 || end < here || static_cast<std::size_t>(end - here) < count) {
    throw std::runtime_error("one that ends early");
  }
  std::fseek(file, here, SEEK_SET);
}

/// Bits `x * bits` and on of a row, the first in the highest bit of a byte; `bits` is 1, 2, 4 or 8.
int packed(const std::uint8_t* row, int x, int bits) {
  const int place = x * bits;
  return row[place / 8] >> (8 - bits - place % 8) & ((1 << bits) - 1);
}

struct BmpHeader {
  ImageSize size;
  bool top_down = false;
  int bits = 0;                       ///< of a pixel
  std::vector<std::uint8_t> palette;  ///< blue, green, red and nothing of each colour
  std::size_t pixels_at = 0;          ///< in the file
};

BmpHeader read_bmp_header(std::FILE* file) {
  std::array<std::uint8_t, 14 + 40> bytes;  // of the file, of the image
  read_exactly(file, bytes.data(), bytes.size());
  const auto number = [&](std::size_t at) {
    return bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16 |
           static_cast<std::uint32_t>(bytes[at + 3]) << 24;
  };
  const std::uint32_t header_bytes = number(14);
  const auto width = static_cast<std::int32_t>(number(18));
  const auto height = static_cast<std::int32_t>(number(22));
  const int bits = bytes[28] | bytes[29] << 8;
  const std::uint32_t compression = number(30);
  const std::uint32_t colours = number(46);
  if (header_bytes < 40 || header_bytes > 4096) {
    throw std::runtime_error("a header of " + std::to_string(header_bytes) + " bytes");
  }
  const int rows = height < 0 ? -std::max(height, -INT32_MAX) : height;
  BmpHeader header{{rows, width}, height < 0, bits, {}, number(10)};
  check_image_size(header.size);
  constexpr std::uint32_t kPlain = 0;
  constexpr std::uint32_t kMasks = 3;
  const bool known = bits == 1 || bits == 4 || bits == 8 || bits == 24 || bits == 32;
  if (!known || (compression != kPlain && (bits != 32 || compression != kMasks))) {
    throw std::runtime_error("one of " + std::to_string(bits) + " bits and compression " +
                             std::to_string(compression));
  }
  if (compression == kMasks) {  // they follow a header of 40 bytes, and are in a longer one
    std::array<std::uint8_t, 12> masks;
    read_exactly(file, masks.data(), masks.size());
    constexpr std::array<std::uint8_t, 12> kBgr{0, 0, 255, 0, 0, 255, 0, 0, 255, 0, 0, 0};
    if (masks != kBgr) throw std::runtime_error("one of other than 8 bits a colour");
  }
  if (bits <= 8) {
    if (colours > 1u << bits) {
      throw std::runtime_error("a palette of " + std::to_string(colours) + " colours");
    }
    header.palette.resize(4 * (colours == 0 ? std::size_t{1} << bits : colours));
    std::fseek(file, static_cast<long>(14 + header_bytes), SEEK_SET);
    read_exactly(file, header.palette.data(), header.palette.size());
  }
  return header;
}

}  // namespace

ImageSize bmp_size(std::FILE* file) { return read_bmp_header(file).size; }

ColourFrame decode_bmp(std::FILE* file) {
  const BmpHeader header = read_bmp_header(file);
  const auto [height, width] = header.size;
  std::fseek(file, static_cast<long>(header.pixels_at), SEEK_SET);
  Buffer row((static_cast<std::size_t>(width) * header.bits + 31) / 32 * 4);
  require_bytes(file, row.size() * height);
  ColourFrame frame{header.size, Buffer(3 * header.size.pixel_count())};
  for (int i = 0; i < height; ++i) {
    read_exactly(file, row.data(), row.size());
    const int y = header.top_down ? i : height - 1 - i;
    std::uint8_t* to = frame.bgr.data() + 3 * static_cast<std::size_t>(y) * width;
    for (int x = 0; x < width; ++x, to += 3) {
      const std::uint8_t* colour = row.data() + static_cast<std::size_t>(x) * (header.bits / 8);
      if (header.bits <= 8) {
        const std::size_t index = packed(row.data(), x, header.bits);
        if (4 * index >= header.palette.size()) {
          throw std::runtime_error("a pixel of colour " + std::to_string(index) +
                                   " in a palette of " + std::to_string(header.palette.size() / 4));
        }
        colour = header.palette.data() + 4 * index;
      }
      std::copy_n(colour, 3, to);
    }
  }
  return frame;
}

namespace {

struct PnmHeader {
  ImageSize size;
  char kind = '1';  ///< 1 and 4: bits, 2 and 5: grey, 3 and 6: colour; from 4 on binary
  int greatest = 1;

  bool is_bits() const { return kind == '1' || kind == '4'; }
};

/// The next number, after white space and comments ("# ..."), and the white space behind it, which
/// is missing where the file was cut; of bits one digit alone.
int read_number(std::FILE* file, bool is_bit = false) {
  int next = std::getc(file);
  while (std::isspace(next) != 0 || next == '#') {
    const bool in_comment = next == '#';
    do {
      next = std::getc(file);
    } while (in_comment && next != '\n' && next != '\r' && next != EOF);
  }
  int value = 0;
  int digits = 0;
  for (; std::isdigit(next) != 0 && digits < (is_bit ? 1 : 9); ++digits) {
    value = 10 * value + (next - '0');
    if (!is_bit) next = std::getc(file);
  }
  if (next == EOF) throw std::runtime_error("one that ends early");
  if (digits == 0 || (!is_bit && std::isspace(next) == 0)) {
    throw std::runtime_error("something else than a number");
  }
  return value;
}

PnmHeader read_pnm_header(std::FILE* file) {
  PnmHeader header;
  std::getc(file);  // P
  header.kind = static_cast<char>(std::getc(file));
  header.size.width = read_number(file);
  header.size.height = read_number(file);
  check_image_size(header.size);
  if (header.kind != '1' && header.kind != '4') header.greatest = read_number(file);
  if (header.greatest < 1 || header.greatest > 65535) {
    throw std::runtime_error("values up to " + std::to_string(header.greatest));
  }
  return header;
}

}  // namespace

ImageSize pnm_size(std::FILE* file) { return read_pnm_header(file).size; }

namespace {

/// Reads the pixels; `take(value, header)` makes a channel of each.
template <class Channel, class Take>
std::vector<Channel> read_pixels(std::FILE* file, const PnmHeader& header, const Take& take) {
  const bool is_binary = header.kind >= '4';
  const bool is_bits = header.is_bits();
  const bool is_wide = header.greatest > 255;
  const int channels = header.kind == '3' || header.kind == '6' ? 3 : 1;
  const int count = channels * header.size.width;  // of values in a row
  Buffer row(is_bits ? (count + 7) / 8 : is_wide ? 2 * count : count);
  require_bytes(file, row.size() * header.size.height);  // as text it is longer
  std::vector<Channel> bgr(3 * header.size.pixel_count());
  Channel* to = bgr.data();
  for (int y = 0; y < header.size.height; ++y, to += 3 * header.size.width) {
    if (is_binary) read_exactly(file, row.data(), row.size());
    for (int i = 0; i < count; ++i) {
      const int value = !is_binary ? read_number(file, is_bits)
                        : is_bits  ? packed(row.data(), i, 1)
                        : is_wide  ? row[2 * i] << 8 | row[2 * i + 1]
                                   : row[i];
      if (value > header.greatest) {
        throw std::runtime_error("a value of " + std::to_string(value) + " beyond " +
                                 std::to_string(header.greatest));
      }
      const auto channel = static_cast<Channel>(take(value));
      if (channels == 1) {
        std::fill_n(to + 3 * i, 3, channel);
      } else {
        to[i - i % 3 + 2 - i % 3] = channel;  // blue first
      }
    }
  }
  return bgr;
}

}  // namespace

ColourFrame decode_pnm(std::FILE* file) {
  const PnmHeader header = read_pnm_header(file);
  return {header.size, read_pixels<std::uint8_t>(file, header, [&](int value) {
            return header.is_bits()           ? 255 * (1 - value)
                   : header.greatest == 65535 ? value >> 8
                                              : value * 255 / header.greatest;
          })};
}

std::optional<WideFrame> decode_wide_pnm(std::FILE* file) {
  const PnmHeader header = read_pnm_header(file);
  if (header.greatest <= 255) return std::nullopt;
  return WideFrame{header.size,
                   read_pixels<std::uint16_t>(file, header, [](int value) { return value; })};
}

}  // namespace eventgan
