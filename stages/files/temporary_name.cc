#include "stages/files/temporary_name.h"

#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>

namespace eventgan {
namespace {

constexpr std::string_view kEnding = ".tmp";

/// Cuts ".NUMBER" off the end of `text`; false if there is none.
template <class Number>
bool take_number(std::string_view& text, Number& number) {
  const std::size_t dot = text.rfind('.');
  if (dot == std::string_view::npos) return false;
  const std::string_view digits = text.substr(dot + 1);
  const auto [end, error] = std::from_chars(digits.begin(), digits.end(), number);
  if (error != std::errc() || end != digits.end()) return false;
  text = text.substr(0, dot);
  return true;
}

}  // namespace

std::string to_string(const TemporaryName& name) {
  return "." + name.target + "." + name.host + "." + std::to_string(name.pid) + "." +
         std::to_string(name.attempt) + std::string(kEnding);
}

std::optional<TemporaryName> parse_temporary_name(std::string_view name) {
  if (!name.starts_with('.') || !name.ends_with(kEnding)) return std::nullopt;
  name = name.substr(1, name.size() - 1 - kEnding.size());
  TemporaryName parsed;
  if (!take_number(name, parsed.attempt) || !take_number(name, parsed.pid)) return std::nullopt;
  // Unlike the target, the host has no dots.
  const std::size_t dot = name.rfind('.');
  if (dot == std::string_view::npos) return std::nullopt;
  parsed.target = name.substr(0, dot);
  parsed.host = name.substr(dot + 1);
  const bool whole = parsed.pid > 0 && !parsed.target.empty() && !parsed.host.empty();
  return whole ? std::optional(parsed) : std::nullopt;
}

std::string without_dots(std::string machine) {
  std::replace_if(
      machine.begin(), machine.end(), [](char c) { return c == '.' || c == '/'; }, '_');
  return machine;
}

std::string host_name() {
  std::array<char, HOST_NAME_MAX + 1> name{};
  const bool named = ::gethostname(name.data(), name.size() - 1) == 0 && name[0] != '\0';
  std::string host = without_dots(named ? name.data() : "localhost");
  struct stat space {};
  if (::stat("/proc/self/ns/pid", &space) == 0) host += "-" + std::to_string(space.st_ino);
  return host;
}

}  // namespace eventgan
