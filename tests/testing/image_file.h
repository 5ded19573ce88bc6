#pragma once

#include <filesystem>

#include "manifests/values/frames.h"

namespace eventgan::testing {

/// Writes a grey 8-bit image (PNG or JPEG, by the name) of one value, creating the folders above
/// it.
void write_flat_image(const std::filesystem::path& path, ImageSize size, int value);

}  // namespace eventgan::testing
