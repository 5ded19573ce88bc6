#include "stages/frames/decoding/png_picture.h"

#include <png.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stages/frames/decoding/escape_internal.h"
#include "stages/frames/decoding/picture_limits.h"
#include "stages/frames/decoding/stored_png.h"

namespace eventgan {
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
        png_set_option(png_, PNG_IGNORE_ADLER32, PNG_OPTION_ON);  // compared when inflated
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
    check_picture_size(size);
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
  /// Each row's indices, which stand at its start, become colours. libpng would do it, but takes an
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
