#include "stages/files/temporary_name.h"

#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

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

std::optional<TemporaryName> parse_temporary_name(std::string_view name, std::string_view host) {
  if (!name.starts_with('.') || !name.ends_with(kEnding)) return std::nullopt;
  name = name.substr(1, name.size() - 1 - kEnding.size());
  TemporaryName parsed;
  if (!take_number(name, parsed.attempt) || !take_number(name, parsed.pid)) return std::nullopt;
  // Only now the host: it can hold dots and digits itself.
  if (!name.ends_with(host)) return std::nullopt;
  name.remove_suffix(host.size());
  if (name.size() < 2 || !name.ends_with('.')) return std::nullopt;
  name.remove_suffix(1);
  parsed.target = name;
  parsed.host = host;
  return parsed.pid > 0 ? std::optional(parsed) : std::nullopt;
}

std::string host_name() {
  std::array<char, HOST_NAME_MAX + 1> name{};
  const bool named = ::gethostname(name.data(), name.size() - 1) == 0 && name[0] != '\0';
  std::string host = named ? name.data() : "localhost";
  struct stat space {};
  if (::stat("/proc/self/ns/pid", &space) == 0) host += "-" + std::to_string(space.st_ino);
  return host;
}

}  // namespace eventgan
