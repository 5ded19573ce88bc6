#pragma once

#include <filesystem>
#include <string>

namespace eventgan {

/// The extension with its dot, in small letters: ".json" for "a.JSON"; empty if there is none.
std::string lower_extension(const std::filesystem::path& file);

}  // namespace eventgan
