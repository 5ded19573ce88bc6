#pragma once

#include <cstdio>

#include "manifests/image_size.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// Decodes a PNG file, open at its start, to the same pixels as OpenCV's imread: 16 bits are cut to
/// the upper 8, transparency is dropped, palettes and grey become colour. Throws std::runtime_error
/// saying what is wrong if the file is not whole, a checksum of its picture data does not match, a
/// pixel is a colour that its palette does not have, or the picture is too large. Thread safe.
ColourFrame decode_png(std::FILE* file);

/// Size from the header alone. Throws std::runtime_error. Thread safe.
ImageSize png_size(std::FILE* file);

}  // namespace eventgan
