#pragma once

#include <cstdint>
#include <cstdio>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/base/images/image_file.h"

namespace eventgan {

/// Decodes a JPEG file, open at its start, to the same pixels as OpenCV's imread, which however
/// returns an image with a grey rest where data is missing. An orientation tag (EXIF) is not
/// applied: labels are given in stored pixels.
/// Throws std::runtime_error saying what is wrong if any pixel is missing or in doubt, if the
/// image is too large, or if its colours are neither grey nor YCbCr nor RGB. Thread safe.
ColourFrame decode_jpeg(std::FILE* file);

/// Size from the header alone. Throws std::runtime_error. Thread safe.
ImageSize jpeg_size(std::FILE* file);

/// Decodes a PNG file, open at its start, to the same pixels as OpenCV's imread: 16 bits are cut to
/// the upper 8, transparency is dropped, palettes and grey become colour. Throws std::runtime_error
/// saying what is wrong if the file is not whole, a checksum of its image data does not match, a
/// pixel is a colour that its palette does not have, or the image is too large. Thread safe.
ColourFrame decode_png(std::FILE* file);

/// Size from the header alone. Throws std::runtime_error. Thread safe.
ImageSize png_size(std::FILE* file);

/// The same PNG with its pixel data no longer compressed ("stored" deflate blocks, RFC 1951 section
/// 3.2.4; every other chunk byte for byte), so that libpng has nothing left to inflate: libdeflate
/// does that much faster than the zlib that libpng uses, but only for data that lies in memory as a
/// whole.
///
/// Empty if there is any doubt about the file, or if it or its pixel data takes more than 256 MiB:
/// then libpng should read the file itself and judge it. Without doubt means: eight bytes where the
/// signature should be, a header of an image within kMaxImagePixels that is not interlaced,
/// whole chunks up to the end chunk, all pixel data in one run, its checksums (CRC-32 of each
/// chunk, Adler-32 of the whole) right, and exactly as much of it as the header says. Reads `file`
/// from its start; where it is after that is undefined. Thread safe.
std::vector<std::uint8_t> stored_png(std::FILE* file);

}  // namespace eventgan
