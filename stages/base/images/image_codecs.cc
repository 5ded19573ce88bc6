#include "stages/base/images/image_codecs.h"

#include <libdeflate.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
// jpeglib.h needs <cstddef> and <cstdio> above it.
#include <jerror.h>
#include <jpeglib.h>

#include "stages/base/images/image_file.h"

namespace eventgan {
namespace {

/// Where libjpeg and libpng jump to when they give up: both are C and leave by longjmp.
struct Escape {
  std::jmp_buf place;
  char message[256] = "";

  [[noreturn]] void leave(const char* why) {
    std::snprintf(message, sizeof message, "%s", why);
    std::longjmp(place, 1);
  }
};

/// Runs `step`; throws std::runtime_error with the library's message if it left through `escape`.
/// longjmp runs no destructor: `step` must own nothing.
template <class Step>
void run_guarded(Escape& escape, Step step) {
  if (setjmp(escape.place) != 0) throw std::runtime_error(escape.message);
  step();
}

Escape& escape_of(j_common_ptr codec) { return *static_cast<Escape*>(codec->client_data); }

[[noreturn]] void leave_with_message(j_common_ptr codec) {
  char message[JMSG_LENGTH_MAX];
  codec->err->format_message(codec, message);
  escape_of(codec).leave(message);
}

/// libjpeg warns, and then invents pixels, where data is corrupt; only what leaves the pixels alone
/// is let pass.
void refuse_corrupt_data(j_common_ptr codec, int level) {
  const int code = codec->err->msg_code;
  const bool harmless =
      level >= 0 || code == JWRN_JFIF_MAJOR || code == JWRN_ADOBE_XFORM || code == JWRN_BOGUS_ICC;
  if (!harmless) leave_with_message(codec);
}

class JpegFile {
 public:
  explicit JpegFile(std::FILE* file) {
    codec_.err = jpeg_std_error(&errors_);
    errors_.error_exit = leave_with_message;
    errors_.emit_message = refuse_corrupt_data;
    codec_.client_data = &escape_;
    run_guarded(escape_, [&] {
      jpeg_create_decompress(&codec_);
      jpeg_stdio_src(&codec_, file);
    });
  }
  ~JpegFile() { jpeg_destroy_decompress(&codec_); }
  JpegFile(const JpegFile&) = delete;
  JpegFile& operator=(const JpegFile&) = delete;

  ImageSize read_header() {
    run_guarded(escape_, [&] { jpeg_read_header(&codec_, TRUE); });
    const ImageSize size{static_cast<int>(codec_.image_height),
                         static_cast<int>(codec_.image_width)};
    check_image_size(size);
    return size;
  }

  ColourFrame read() {
    ColourFrame frame{read_header(), {}};
    if (codec_.num_components != 1 && codec_.num_components != 3) {
      throw std::runtime_error(std::to_string(codec_.num_components) + " colour channels");
    }
    frame.bgr.resize(3 * frame.size.pixel_count());
    codec_.out_color_space = JCS_EXT_BGR;
    const std::size_t row_bytes = 3 * static_cast<std::size_t>(frame.size.width);
    run_guarded(escape_, [&] {
      jpeg_start_decompress(&codec_);
      while (codec_.output_scanline < codec_.output_height) {
        JSAMPROW row = frame.bgr.data() + codec_.output_scanline * row_bytes;
        jpeg_read_scanlines(&codec_, &row, 1);
      }
      jpeg_finish_decompress(&codec_);  // reads on to the end marker
    });
    return frame;
  }

 private:
  jpeg_decompress_struct codec_{};
  jpeg_error_mgr errors_{};
  Escape escape_;
};

}  // namespace

ColourFrame decode_jpeg(std::FILE* file) { return JpegFile(file).read(); }

ImageSize jpeg_size(std::FILE* file) { return JpegFile(file).read_header(); }

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
  if (width == 0 || height == 0 || width > kMaxImagePixels || height > kMaxImagePixels ||
      width * height > kMaxImagePixels || bits > 16 || kind >= kChannels.size() || interlaced) {
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

namespace {

[[noreturn]] void leave_with_message(png_structp png, png_const_charp message) {
  static_cast<Escape*>(png_get_error_ptr(png))->leave(message);
}

void ignore_warning(png_structp, png_const_charp) {}

void read_from_memory(png_structp png, png_bytep to, std::size_t count) {
  auto& left = *static_cast<std::span<const std::uint8_t>*>(png_get_io_ptr(png));
  if (count > left.size()) png_error(png, "Read Error");
  std::memcpy(to, left.data(), count);
  left = left.subspan(count);
}

class PngFile {
 public:
  /// Reads `file`, or `stored` unless that is empty: the same file with its pixel data inflated.
  explicit PngFile(std::FILE* file, std::vector<std::uint8_t> stored = {})
      : stored_(std::move(stored)), left_(stored_) {
    run_guarded(escape_, [&] {
      png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &escape_, leave_with_message,
                                    ignore_warning);
      if (png_ == nullptr) escape_.leave("cannot start libpng");
      info_ = png_create_info_struct(png_);
      if (info_ == nullptr) escape_.leave("cannot start libpng");
      png_init_io(png_, file);
      if (!stored_.empty()) {
        png_set_read_fn(png_, &left_, read_from_memory);
#ifdef PNG_IGNORE_ADLER32  // not in every libpng: then it compares again what inflating compared
        png_set_option(png_, PNG_IGNORE_ADLER32, PNG_OPTION_ON);
#endif
      }
      // What is said beside the pixels (colour profiles, text) may be damaged, the pixels may not.
      png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
      png_set_benign_errors(png_, 0);
    });
  }
  ~PngFile() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngFile(const PngFile&) = delete;
  PngFile& operator=(const PngFile&) = delete;

  ImageSize read_header() {
    run_guarded(escape_, [&] { png_read_info(png_, info_); });
    const ImageSize size{static_cast<int>(png_get_image_height(png_, info_)),
                         static_cast<int>(png_get_image_width(png_, info_))};
    check_image_size(size);
    return size;
  }

  ColourFrame read() {
    ColourFrame frame{read_header(), {}};
    frame.bgr.resize(3 * frame.size.pixel_count());
    const std::size_t row_bytes = 3 * static_cast<std::size_t>(frame.size.width);
    std::vector<png_bytep> rows;
    rows.reserve(static_cast<std::size_t>(frame.size.height));
    for (int y = 0; y < frame.size.height; ++y) rows.push_back(frame.bgr.data() + y * row_bytes);
    const bool has_palette = png_get_color_type(png_, info_) == PNG_COLOR_TYPE_PALETTE;
    run_guarded(escape_, [&] {
      if (has_palette) {
        png_set_packing(png_);  // a byte for each index
        png_set_interlace_handling(png_);
      } else {
        set_conversions();
      }
      png_read_update_info(png_, info_);
      if (png_get_rowbytes(png_, info_) != (has_palette ? row_bytes / 3 : row_bytes)) {
        escape_.leave("unexpected kind of pixels");
      }
      png_read_image(png_, rows.data());
      png_read_end(png_, nullptr);
    });
    if (has_palette) look_up_colours(frame, rows);
    return frame;
  }

 private:
  /// Each row's indices, which are at its start, become colours. libpng would do it, but takes an
  /// index beyond the palette for black.
  void look_up_colours(const ColourFrame& frame, const std::vector<png_bytep>& rows) {
    png_colorp palette = nullptr;
    int count = 0;
    png_get_PLTE(png_, info_, &palette, &count);
    for (const png_bytep row : rows) {
      for (int x = frame.size.width - 1; x >= 0; --x) {  // a colour never covers an index still due
        const int index = row[x];
        if (index >= count) {
          throw std::runtime_error("a pixel of colour " + std::to_string(index) +
                                   " in a palette of " + std::to_string(count));
        }
        const png_color& colour = palette[index];
        row[3 * x] = colour.blue;
        row[3 * x + 1] = colour.green;
        row[3 * x + 2] = colour.red;
      }
    }
  }

  /// Whatever the file holds but a palette, to 8-bit blue, green, red.
  void set_conversions() {
    png_set_strip_16(png_);
    png_set_strip_alpha(png_);
    const png_byte kind = png_get_color_type(png_, info_);
    if ((kind & PNG_COLOR_MASK_COLOR) == 0) {
      if (png_get_bit_depth(png_, info_) < 8) png_set_expand_gray_1_2_4_to_8(png_);
      png_set_gray_to_rgb(png_);
    } else {
      png_set_bgr(png_);
    }
    png_set_interlace_handling(png_);
  }

  std::vector<std::uint8_t> stored_;
  std::span<const std::uint8_t> left_;  ///< of it
  Escape escape_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

ColourFrame decode_png(std::FILE* file) {
  std::vector<std::uint8_t> stored = stored_png(file);
  std::rewind(file);
  return PngFile(file, std::move(stored)).read();
}

ImageSize png_size(std::FILE* file) { return PngFile(file).read_header(); }

}  // namespace eventgan
