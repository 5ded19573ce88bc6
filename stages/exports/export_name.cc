#include "stages/exports/export_name.h"

#include <fmt/core.h>

#include "stages/base/files/sha256.h"

namespace eventgan {
namespace {

constexpr std::size_t kLongest =
    75;  // with a prefix and an extension within the 100 bytes of a tar's names
constexpr std::size_t kHashDigits = 16;

bool is_plain(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '-' || c == '@';
}

}  // namespace

std::string export_name(std::string_view sample_id) {
  std::string name;
  for (const char c : sample_id) {
    if (is_plain(c)) {
      name += c;
    } else if (c == '/') {
      name += '+';
    } else {
      name += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  if (name.size() <= kLongest) return name;
  return name.substr(0, kLongest - 1 - kHashDigits) + "~" +
         sha256_hex(sample_id).substr(0, kHashDigits);
}

}  // namespace eventgan
