#include "manifests/documents/format_version.h"

#include <charconv>

namespace eventgan {
namespace {

/// Takes a part of a version, digits without leading zeros, off the front of `text`; none where
/// there are no such.
std::optional<int> take_part(std::string_view& text) {
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const auto digits = static_cast<std::size_t>(end - text.data());
  if (error != std::errc() || text[0] == '-' || (text[0] == '0' && digits > 1)) return std::nullopt;
  text.remove_prefix(digits);
  return number;
}

}  // namespace

std::string to_string(FormatVersion version) {
  return std::to_string(version.major) + "." + std::to_string(version.minor);
}

std::optional<FormatVersion> readable_version(std::string_view text, FormatVersion own) {
  const auto major = take_part(text);
  if (major != own.major || !text.starts_with('.')) return std::nullopt;
  text.remove_prefix(1);
  const auto minor = take_part(text);
  if (!minor || !text.empty()) return std::nullopt;
  return FormatVersion{*major, *minor};
}

std::string readable_versions(FormatVersion own) {
  const std::string major = std::to_string(own.major);
  return "\"" + to_string(own) + "\" (this program reads versions " + major + ".x)";
}

}  // namespace eventgan
