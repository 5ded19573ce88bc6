#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace eventgan {

/// SHA-256 as 64 lower-case hex digits. Thread safe.
std::string sha256_hex(std::span<const std::byte> bytes);
std::string sha256_hex(std::string_view text);

/// Of a file's content, read in blocks. Throws std::runtime_error naming the path.
std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace eventgan
