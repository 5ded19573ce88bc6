#include <algorithm>
#include <string_view>

#include "manifests/manifest_text_internal.h"

namespace eventgan {

std::string read_path(const StrictValue& value) {
  return value.text("a path", [](std::string_view text) {
    return !text.empty() && text.find('\0') == std::string_view::npos;
  });
}

std::string read_name(const StrictValue& value) {
  constexpr auto is_name = [](std::string_view text) {
    const auto belongs = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
             c == '.' || c == '_' || c == '-';
    };
    return !text.empty() && text.size() <= 64 && text[0] != '.' && text[0] != '-' &&
           std::all_of(text.begin(), text.end(), belongs);
  };
  return value.text(
      "1..64 letters, digits, \".\", \"_\" or \"-\", not beginning with \".\" or \"-\"", is_name);
}

}  // namespace eventgan
