#pragma once

#include <filesystem>
#include <string>

namespace eventgan {

/// A whole file as it stands. Throws std::runtime_error naming the path if there is none, or it
/// cannot be read. Thread safe.
std::string read_text_file(const std::filesystem::path& file);

}  // namespace eventgan
