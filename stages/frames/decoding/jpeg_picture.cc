#include "stages/frames/decoding/jpeg_picture.h"

#include <cstddef>
#include <stdexcept>
// jpeglib.h needs the two above it.
#include <jerror.h>
#include <jpeglib.h>

#include "stages/frames/decoding/escape_internal.h"
#include "stages/frames/decoding/picture_limits.h"

namespace eventgan {
namespace {

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
    check_picture_size(size);
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

}  // namespace eventgan
