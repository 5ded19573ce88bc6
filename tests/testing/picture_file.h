#pragma once

#include <filesystem>

#include "manifests/values/frames.h"

namespace eventgan::testing {

/// Writes a grey 8-bit picture (PNG or JPEG, by the name) of one value, creating the folders above
/// it.
void write_flat_picture(const std::filesystem::path& path, ImageSize size, int value);

}  // namespace eventgan::testing
