#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace eventgan::testing {

/// Writes a file, creating the folders above it.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// Reads a whole file; throws if it cannot be opened.
std::string read_file(const std::filesystem::path& path);

/// Whether a file of the tree, such as a page, is `made`, what its tables give. With
/// EVENTGAN_WRITE_MADE_FILES=1 in the environment it is written first.
bool is_as_made(const std::filesystem::path& path, std::string_view made);

}  // namespace eventgan::testing
