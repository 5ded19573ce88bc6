#include "stages/frames/sequences/lower_extension.h"

#include <algorithm>
#include <cctype>

namespace eventgan {

std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace eventgan
