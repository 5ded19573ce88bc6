#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace eventgan {

/// The number in decimal, with zeros in front up to `digits`.
std::string numbered(int number, int digits);

/// Writes a file whose folder exists. Throws std::runtime_error naming the path.
void write_text(const std::filesystem::path& path, std::string_view text);

/// Copies a file to a new path. Throws std::runtime_error naming both.
void copy_output(const std::filesystem::path& from, const std::filesystem::path& to);

/// Makes a folder and those above it. Throws std::runtime_error naming the path.
void make_folder(const std::filesystem::path& path);

}  // namespace eventgan
