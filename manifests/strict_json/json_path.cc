#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_path_internal.h"
#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {

std::string json_path(std::string_view parent, std::string_view key) {
  const bool is_word = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return c < 0x80 && (std::isalnum(c) || c == '_');
  });
  std::string path(parent);
  if (is_word) return path.append(".").append(key);
  const std::string quoted = dump_json(nlohmann::json(key), JsonLayout::kAsciiLine);
  return path.append("[").append(quoted).append("]");
}

std::string json_path(std::string_view parent, std::size_t index) {
  return std::string(parent) + "[" + std::to_string(index) + "]";
}

}  // namespace eventgan
