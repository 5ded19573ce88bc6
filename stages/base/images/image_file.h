#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "manifests/values/frames.h"

namespace eventgan {

/// A decoded colour image: [y, x, channel] uint8, C order, channels blue, green, red, 0..255.
struct ColourFrame {
  ImageSize size;
  std::vector<std::uint8_t> bgr;
};

/// The same, owned by somebody else.
struct ColourView {
  ImageSize size;
  const std::uint8_t* bgr = nullptr;
};

/// A header may announce any size; images beyond this many pixels are refused before memory is
/// taken for them.
inline constexpr std::size_t kMaxImagePixels = std::size_t{1} << 26;

/// Throws std::runtime_error ("a size of WxH, not 1 to N pixels") if the size is empty or beyond
/// the limit.
void check_image_size(ImageSize size);

/// What OpenCV and FFmpeg would write to the standard error stream about a damaged file, which
/// the functions here and VideoFile report as exceptions, is dropped from now on. (FFmpeg's is not
/// if OPENCV_FFMPEG_LOGLEVEL is set.) To be called before there are other threads.
void silence_decoders();

/// True if the file is an image by its first bytes, whatever its name. Throws std::runtime_error
/// saying what is wrong ("expected an image, got an empty file") if it is missing, empty or a
/// folder.
bool is_image_file(const std::filesystem::path& file);

/// Decodes an image file: JPEG and PNG strictly (image_codecs.h), other
/// formats as OpenCV does. Throws std::runtime_error saying what is wrong ("expected a whole PNG,
/// got ..."), without the file's name. Thread safe.
ColourFrame decode_image_file(const std::filesystem::path& file);

/// The size alone: of a JPEG or PNG from its header, of other formats by decoding. Throws as above.
ImageSize image_file_size(const std::filesystem::path& file);

}  // namespace eventgan
