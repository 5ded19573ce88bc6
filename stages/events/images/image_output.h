#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "stages/base/images/image_file.h"

namespace eventgan {

// Images as files. All throw std::runtime_error, naming the path where there is one, if they
// cannot be encoded or written. A file is under its name whole or not at all (atomic_file.h).

void write_png(const ColourFrame& image, const std::filesystem::path& path);

/// The bytes of a JPEG of at most `most_bytes`, in the best of a few qualities that fits; where
/// none does, of the image in half its size, and so on.
std::string jpeg_of(const ColourFrame& image, std::size_t most_bytes);

}  // namespace eventgan
