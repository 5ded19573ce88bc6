#pragma once

#include <cstdint>
#include <cstdio>
#include <vector>

namespace eventgan {

/// The same PNG with its pixel data no longer compressed ("stored" deflate blocks, RFC 1951 section
/// 3.2.4; every other chunk byte for byte), so that libpng has nothing left to inflate: libdeflate
/// does that much faster than the zlib that libpng uses, but only for data that lies in memory as a
/// whole.
///
/// Empty if there is any doubt about the file, or if it or its pixel data takes more than 256 MiB:
/// then libpng should read the file itself and judge it. Without doubt means: eight bytes where the
/// signature should be, a header of a picture within kMaxPicturePixels that is not interlaced,
/// whole chunks up to the end chunk, all pixel data in one run, its checksums (CRC-32 of each
/// chunk, Adler-32 of the whole) right, and exactly as much of it as the header says. Reads `file`
/// from its start; where it stands after that is undefined. Thread safe.
std::vector<std::uint8_t> stored_png(std::FILE* file);

}  // namespace eventgan
