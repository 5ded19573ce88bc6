#pragma once

#include <cstdio>

#include "manifests/image_size.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// Decodes a JPEG file, open at its start, to the same pixels as OpenCV's imread, which however
/// returns a picture with a grey rest where data is missing. An orientation tag (EXIF) is not
/// applied: labels are given in stored pixels.
/// Throws std::runtime_error saying what is wrong if any pixel is missing or in doubt, if the
/// picture is too large, or if its colours are neither grey nor YCbCr nor RGB. Thread safe.
ColourFrame decode_jpeg(std::FILE* file);

/// Size from the header alone. Throws std::runtime_error. Thread safe.
ImageSize jpeg_size(std::FILE* file);

}  // namespace eventgan
