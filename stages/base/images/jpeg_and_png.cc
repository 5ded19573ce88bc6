#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <new>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/base/images/image_codecs.h"
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

/// A scan takes as long as an image, whatever few bytes it has: libjpeg-turbo advises a limit. The
/// largest that encoders write is about a dozen.
void refuse_many_scans(j_common_ptr codec) {
  constexpr int kMostScans = 500;
  const int scans = reinterpret_cast<j_decompress_ptr>(codec)->input_scan_number;
  if (scans <= kMostScans) return;
  static_cast<Escape*>(codec->client_data)->leave("expected a JPEG of at most 500 scans, got more");
}

class JpegFile {
 public:
  explicit JpegFile(std::FILE* file) {
    progress_.progress_monitor = refuse_many_scans;
    codec_.err = jpeg_std_error(&errors_);
    errors_.error_exit = leave_with_message;
    errors_.emit_message = refuse_corrupt_data;
    codec_.client_data = &escape_;
    try {
      run_guarded(escape_, [&] {
        jpeg_create_decompress(&codec_);
        codec_.progress = &progress_;
        jpeg_stdio_src(&codec_, file);
      });
    } catch (...) {
      jpeg_destroy_decompress(&codec_);
      throw;
    }
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

  int read_orientation() {
    run_guarded(escape_, [&] { jpeg_save_markers(&codec_, JPEG_APP0 + 1, 0xffff); });
    read_header();
    for (jpeg_saved_marker_ptr marker = codec_.marker_list; marker; marker = marker->next) {
      const Buffer block(marker->data, marker->data + marker->data_length);
      constexpr std::array<std::uint8_t, 6> kName = {'E', 'x', 'i', 'f', 0, 0};
      if (block.size() >= kName.size() && std::equal(kName.begin(), kName.end(), block.begin())) {
        return exif_orientation(block);
      }
    }
    return 1;
  }

  ColourFrame read(int reduced_by = 1) {
    ColourFrame frame{read_header(), {}};
    if (codec_.num_components != 1 && codec_.num_components != 3) {
      throw std::runtime_error(std::to_string(codec_.num_components) + " colour channels");
    }
    ImageSize& size = frame.size;
    if (size.width % reduced_by == 0 && size.height % reduced_by == 0) {
      codec_.scale_num = 1;
      codec_.scale_denom = static_cast<unsigned>(reduced_by);
    }
    codec_.out_color_space = JCS_EXT_BGR;
    run_guarded(escape_, [&] { jpeg_calc_output_dimensions(&codec_); });
    size = {static_cast<int>(codec_.output_height), static_cast<int>(codec_.output_width)};
    frame.bgr.resize(3 * size.pixel_count());
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
  jpeg_progress_mgr progress_{};
  Escape escape_;
};

}  // namespace

ColourFrame decode_jpeg(std::FILE* file) { return JpegFile(file).read(); }

ColourFrame decode_reduced_jpeg(std::FILE* file, int by) { return JpegFile(file).read(by); }

ImageSize jpeg_size(std::FILE* file) { return JpegFile(file).read_header(); }

int jpeg_orientation(std::FILE* file) { return JpegFile(file).read_orientation(); }

std::string encode_jpeg(const ColourView& image, int quality) {
  jpeg_compress_struct codec{};
  jpeg_error_mgr errors{};
  Escape escape;
  codec.err = jpeg_std_error(&errors);
  errors.error_exit = leave_with_message;
  codec.client_data = &escape;
  unsigned char* bytes = nullptr;  // libjpeg's
  unsigned long size = 0;
  const auto encode = [&] {
    jpeg_create_compress(&codec);
    jpeg_mem_dest(&codec, &bytes, &size);
    codec.image_width = static_cast<JDIMENSION>(image.size.width);
    codec.image_height = static_cast<JDIMENSION>(image.size.height);
    codec.input_components = 3;
    codec.in_color_space = JCS_EXT_BGR;
    jpeg_set_defaults(&codec);
    jpeg_set_quality(&codec, quality, TRUE);
    jpeg_start_compress(&codec, TRUE);
    while (codec.next_scanline < codec.image_height) {
      auto row = const_cast<JSAMPROW>(image.bgr + 3ul * codec.next_scanline * codec.image_width);
      jpeg_write_scanlines(&codec, &row, 1);
    }
    jpeg_finish_compress(&codec);
  };
  std::string error;
  try {
    run_guarded(escape, encode);
  } catch (const std::runtime_error& exception) {
    error = exception.what();
  }
  std::string jpeg(reinterpret_cast<const char*>(bytes), error.empty() ? size : 0);
  jpeg_destroy_compress(&codec);
  std::free(bytes);
  if (!error.empty()) throw std::runtime_error("cannot encode an image: " + error);
  return jpeg;
}

namespace {

[[noreturn]] void leave_with_message(png_structp png, png_const_charp message) {
  static_cast<Escape*>(png_get_error_ptr(png))->leave(message);
}

void ignore_warning(png_structp, png_const_charp) {}

class PngFile {
 public:
  explicit PngFile(std::FILE* file) {
    run_guarded(escape_, [&] {
      png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &escape_, leave_with_message,
                                    ignore_warning);
      if (png_ == nullptr) escape_.leave("cannot start libpng");
      info_ = png_create_info_struct(png_);
      if (info_ == nullptr) escape_.leave("cannot start libpng");
      png_init_io(png_, file);
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
    const bool has_palette = png_get_color_type(png_, info_) == PNG_COLOR_TYPE_PALETTE;
    run_guarded(escape_, [&] {
      if (has_palette) {
        png_set_packing(png_);  // a byte for each index
        png_set_interlace_handling(png_);
      } else {
        png_set_strip_16(png_);
        set_conversions();
      }
    });
    const std::size_t width = static_cast<std::size_t>(frame.size.width);
    const auto rows = read_rows(frame.bgr.data(), frame.size, 3, has_palette ? width : 3 * width);
    if (has_palette) look_up_colours(frame, rows);
    return frame;
  }

  std::optional<WideFrame> read_wide() {
    WideFrame frame{read_header(), {}};
    if (png_get_bit_depth(png_, info_) < 16) return std::nullopt;
    frame.bgr.resize(3 * frame.size.pixel_count());
    run_guarded(escape_, [&] {
      if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
      set_conversions();
    });
    const std::size_t row_bytes = 6 * static_cast<std::size_t>(frame.size.width);
    read_rows(frame.bgr.data(), frame.size, 6, row_bytes);
    return frame;
  }

  IndexImage read_indices() {
    IndexImage image{read_header(), {}};
    image.bits = png_get_bit_depth(png_, info_);
    const int kind = png_get_color_type(png_, info_);
    image.has_palette = kind == PNG_COLOR_TYPE_PALETTE;
    if (!image.has_palette && (kind & PNG_COLOR_MASK_COLOR) != 0) {
      throw std::runtime_error("colours, which are neither grey nor a palette's");
    }
    image.indices.resize(image.size.pixel_count());
    const bool is_wide = image.bits == 16;
    run_guarded(escape_, [&] {
      png_set_packing(png_);                      // a byte for each index
      png_set_check_for_invalid_index(png_, -1);  // no colour is looked up
      png_set_strip_alpha(png_);
      if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
      png_set_interlace_handling(png_);
    });
    const auto width = static_cast<std::size_t>(image.size.width);
    const auto rows = read_rows(image.indices.data(), image.size, 2, (is_wide ? 2 : 1) * width);
    for (std::size_t y = 0; !is_wide && y < rows.size(); ++y) {
      // Each byte is at the row's start still, before the place of its own number.
      for (std::size_t x = width; x-- > 0;) image.indices[y * width + x] = rows[y][x];
    }
    return image;
  }

 private:
  /// Reads the pixels, `row_bytes` of each row to its place among pixels of so many bytes.
  std::vector<png_bytep> read_rows(void* pixels, ImageSize size, std::size_t pixel_bytes,
                                   std::size_t row_bytes) {
    std::vector<png_bytep> rows;
    rows.reserve(static_cast<std::size_t>(size.height));
    const std::size_t between = pixel_bytes * static_cast<std::size_t>(size.width);
    for (int y = 0; y < size.height; ++y) {
      rows.push_back(static_cast<png_bytep>(pixels) + static_cast<std::size_t>(y) * between);
    }
    run_guarded(escape_, [&] {
      png_read_update_info(png_, info_);
      if (png_get_rowbytes(png_, info_) != row_bytes) {
        escape_.leave("unexpected kind of pixels");
      }
      png_read_image(png_, rows.data());
      png_read_end(png_, nullptr);
    });
    return rows;
  }

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

  /// Whatever the file holds but a palette, to blue, green, red of at least 8 bits.
  void set_conversions() {
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

  Escape escape_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

/// The colours of pixels, the upper 8 bits of each sample: sample k * kNext of every pixel of
/// kPixelBytes is red, green, blue.
template <int kPixelBytes, int kNext>
ColourFrame take_colours(PngPixels& pixels) {
  ColourFrame frame{pixels.size, {}};
  frame.bgr.resize(3 * pixels.size.pixel_count());
  std::uint8_t* to = frame.bgr.data();
  for (int y = 0; y < pixels.size.height; ++y) {
    const std::uint8_t* from = pixels.row(y).data();
    for (int x = 0; x < pixels.size.width; ++x, from += kPixelBytes, to += 3) {
      for (int channel = 0; channel < 3; ++channel) to[2 - channel] = from[channel * kNext];
    }
  }
  return frame;
}

/// Nothing if a pixel is a colour that the palette does not have.
std::optional<ColourFrame> look_up_colours(PngPixels& pixels) {
  ColourFrame frame = take_colours<1, 0>(pixels);
  for (std::size_t i = 0; i < frame.bgr.size(); i += 3) {
    const std::size_t colour = 3 * std::size_t{frame.bgr[i]};
    if (colour >= pixels.palette.size()) return std::nullopt;
    for (std::size_t k = 0; k < 3; ++k) frame.bgr[i + 2 - k] = pixels.palette[colour + k];
  }
  return frame;
}

std::optional<ColourFrame> colours_of(PngPixels& pixels) {
  if (pixels.has_palette) return look_up_colours(pixels);
  switch (10 * pixels.samples + pixels.bits / 8) {
    case 11:
      return take_colours<1, 0>(pixels);
    case 12:
    case 21:
      return take_colours<2, 0>(pixels);
    case 22:
      return take_colours<4, 0>(pixels);
    case 31:
      return take_colours<3, 1>(pixels);
    case 32:
      return take_colours<6, 2>(pixels);
    case 41:
      return take_colours<4, 1>(pixels);
    default:
      return take_colours<8, 2>(pixels);
  }
}

/// Nothing of colours without a palette.
std::optional<IndexImage> indices_of(PngPixels& pixels) {
  if (pixels.samples > 2) return std::nullopt;
  IndexImage image{pixels.size, {}, pixels.bits, pixels.has_palette};
  image.indices.reserve(pixels.size.pixel_count());
  for (int y = 0; y < pixels.size.height; ++y) {
    const std::span<const std::uint8_t> row = pixels.row(y);
    for (std::size_t x = 0; x < row.size(); x += pixels.pixel_bytes()) {
      image.indices.push_back(pixels.bits == 8 ? row[x] : std::uint16_t(256 * row[x] + row[x + 1]));
    }
  }
  return image;
}

}  // namespace

ColourFrame decode_png(std::FILE* file) {
  if (auto pixels = whole_png(file)) {
    if (auto frame = colours_of(*pixels)) return std::move(*frame);
  }
  std::rewind(file);
  return PngFile(file).read();
}

IndexImage decode_index_png(std::FILE* file) {
  if (auto pixels = whole_png(file)) {
    if (auto image = indices_of(*pixels)) return std::move(*image);
  }
  std::rewind(file);
  return PngFile(file).read_indices();
}

std::optional<WideFrame> decode_wide_png(std::FILE* file) { return PngFile(file).read_wide(); }

ImageSize png_size(std::FILE* file) { return PngFile(file).read_header(); }

namespace {

void append_bytes(png_structp png, png_bytep bytes, std::size_t count) {
  try {
    static_cast<std::string*>(png_get_io_ptr(png))
        ->append(reinterpret_cast<const char*>(bytes), count);
    return;
  } catch (const std::bad_alloc&) {
  }
  png_error(png, "no memory");  // which jumps
}

void nothing_to_flush(png_structp) {}

}  // namespace

namespace {

/// Writes a PNG of `bits` a channel. `prepare` is called before the pixels with libpng's writer and
/// header, to say what else there is of either; `row` gives the place of a row's values.
std::string write_png(ImageSize size, int bits, int kind,
                      const std::function<void(png_structp, png_infop)>& prepare,
                      const std::function<const void*(std::size_t)>& row) try {
  std::string bytes;
  Escape escape;
  png_structp png = nullptr;
  png_infop info = nullptr;
  struct Destroyer {
    png_structp& png;
    png_infop& info;
    ~Destroyer() { png_destroy_write_struct(&png, &info); }
  } const destroyer{png, info};
  run_guarded(escape, [&] {
    png =
        png_create_write_struct(PNG_LIBPNG_VER_STRING, &escape, leave_with_message, ignore_warning);
    if (png == nullptr) escape.leave("cannot start libpng");
    info = png_create_info_struct(png);
    if (info == nullptr) escape.leave("cannot start libpng");
    png_set_write_fn(png, &bytes, append_bytes, nothing_to_flush);
    png_set_IHDR(png, info, static_cast<png_uint_32>(size.width),
                 static_cast<png_uint_32>(size.height), bits, kind, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    prepare(png, info);
    for (std::size_t y = 0; y < static_cast<std::size_t>(size.height); ++y) {
      png_write_row(png, static_cast<png_const_bytep>(row(y)));
    }
    png_write_end(png, info);
  });
  return bytes;
} catch (const std::runtime_error& error) {
  throw std::runtime_error(std::string("cannot encode an image: ") + error.what());
}

/// Colours that are told apart, as Pascal VOC has them: the bits of an index, the lowest first, are
/// dealt out to red, green and blue, from the highest bit of these downwards.
std::array<png_color, 256> index_palette() {
  std::array<png_color, 256> palette{};
  for (unsigned index = 0; index < palette.size(); ++index) {
    png_color& colour = palette[index];
    for (unsigned bit = 0; bit < 8; ++bit) {
      png_byte& channel = bit % 3 == 0 ? colour.red : bit % 3 == 1 ? colour.green : colour.blue;
      channel = static_cast<png_byte>(channel | ((index >> bit & 1) << (7 - bit / 3)));
    }
  }
  return palette;
}

}  // namespace

std::string encode_png(const ColourView& image, bool is_drawn) {
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.size.width);
  return write_png(
      image.size, 8, PNG_COLOR_TYPE_RGB,
      [&](png_structp png, png_infop info) {
        char key[] = "Software", name[] = "eventgan";
        png_text software{};
        software.compression = PNG_TEXT_COMPRESSION_NONE;
        software.key = key;
        software.text = name;
        if (is_drawn) png_set_text(png, info, &software, 1);
        // Many times faster than the best compression, and hardly larger for what is drawn.
        png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
        png_set_compression_level(png, 1);
        png_set_compression_strategy(png, 3);  // Z_RLE
        png_write_info(png, info);
        png_set_bgr(png);
      },
      [&](std::size_t y) { return image.bgr + y * row_bytes; });
}

namespace {

/// Rows of so many numbers of 16 bits each.
std::string write_wide_png(ImageSize size, int kind, const std::uint16_t* numbers,
                           std::size_t row_numbers) {
  return write_png(
      size, 16, kind,
      [](png_structp png, png_infop info) {
        png_write_info(png, info);
        if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
      },
      [&](std::size_t y) { return numbers + y * row_numbers; });
}

}  // namespace

std::string encode_wide_png(ImageSize size, std::span<const std::uint16_t> rgb) {
  return write_wide_png(size, PNG_COLOR_TYPE_RGB, rgb.data(),
                        3 * static_cast<std::size_t>(std::max(size.width, 0)));
}

std::string encode_index_png(ImageSize size, std::span<const std::uint16_t> indices) {
  constexpr std::uint16_t kMostWithPalette = 254;  // 255 is nothing, by custom
  const auto width = static_cast<std::size_t>(std::max(size.width, 0));
  if (std::ranges::any_of(indices, [](std::uint16_t index) { return index > kMostWithPalette; })) {
    return write_wide_png(size, PNG_COLOR_TYPE_GRAY, indices.data(), width);
  }
  const std::vector<std::uint8_t> narrow(indices.begin(), indices.end());
  return write_png(
      size, 8, PNG_COLOR_TYPE_PALETTE,
      [](png_structp png, png_infop info) {
        static const std::array<png_color, 256> palette = index_palette();
        png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
        png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_NONE);
        png_write_info(png, info);
      },
      [&](std::size_t y) { return narrow.data() + y * width; });
}

}  // namespace eventgan
