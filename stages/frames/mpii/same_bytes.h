#pragma once

#include <filesystem>

namespace eventgan {

/// True if both files can be read and hold the same bytes. Sizes are compared first.
bool same_bytes(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace eventgan
