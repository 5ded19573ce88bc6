#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace eventgan::testing {

/// Writes a file, creating the folders above it.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// Reads a whole file; throws if it cannot be opened.
std::string read_file(const std::filesystem::path& path);

}  // namespace eventgan::testing
