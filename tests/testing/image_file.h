#pragma once

#include <filesystem>
#include <vector>

#include "manifests/values/frames.h"

namespace eventgan::testing {

/// Writes a grey 8-bit image (PNG or JPEG, by the name) of one value, creating the folders above
/// it.
void write_flat_image(const std::filesystem::path& path, ImageSize size, int value);

enum class IndexPng { kGrey8, kGrey16, kPalette };

/// Writes a PNG of numbers, [y, x], creating the folders above it; of a palette as DAVIS and VOC
/// have them, whose colours are not the numbers.
void write_index_image(const std::filesystem::path& path, ImageSize size,
                       const std::vector<int>& indices, IndexPng kind = IndexPng::kGrey8);

}  // namespace eventgan::testing
