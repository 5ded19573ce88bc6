#pragma once

#include <filesystem>

#include "manifests/image_size.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// What OpenCV and FFmpeg would write to the standard error stream about a damaged file, which
/// the functions here and VideoFile report as exceptions, is dropped from now on. (FFmpeg's is not
/// if OPENCV_FFMPEG_LOGLEVEL is set.) To be called before there are other threads.
void silence_decoders();

/// True if the file is a picture by its first bytes, whatever its name. Throws std::runtime_error
/// saying what is wrong ("expected a picture, got an empty file") if it is missing, empty or a
/// folder.
bool is_picture_file(const std::filesystem::path& file);

/// Decodes a picture file: JPEG and PNG strictly (jpeg_picture.h, png_picture.h), other formats as
/// OpenCV does. Throws std::runtime_error saying what is wrong ("expected a whole PNG, got ..."),
/// without the file's name. Thread safe.
ColourFrame decode_picture_file(const std::filesystem::path& file);

/// The size alone: of a JPEG or PNG from its header, of other formats by decoding. Throws as above.
ImageSize picture_file_size(const std::filesystem::path& file);

}  // namespace eventgan
