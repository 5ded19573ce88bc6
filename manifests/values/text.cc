#include "manifests/values/text.h"

#include <algorithm>
#include <initializer_list>
#include <iomanip>

namespace eventgan {

namespace {

std::string plural_of(const std::string& noun) {
  const auto ends_in_any = [&](std::initializer_list<std::string_view> endings) {
    return std::ranges::any_of(endings, [&](auto ending) { return noun.ends_with(ending); });
  };
  if (ends_in_any({"s", "x", "z", "ch", "sh"})) return noun + "es";
  if (noun.ends_with('y') && !ends_in_any({"ay", "ey", "oy", "uy"})) {
    return noun.substr(0, noun.size() - 1) + "ies";
  }
  return noun + "s";
}

}  // namespace

std::string count_text(std::int64_t count, const std::string& noun, const std::string& rest) {
  return std::to_string(count) + " " + (count == 1 ? noun : plural_of(noun)) + rest;
}

std::string bytes_text(std::int64_t bytes) {
  constexpr std::pair<double, const char*> kUnits[] = {
      {1e12, " TB"}, {1e9, " GB"}, {1e6, " MB"}, {1e3, " kB"}};
  for (const auto& [size, unit] : kUnits) {
    const double in_units = static_cast<double>(bytes) / size;
    if (in_units < 0.9995) continue;  // rounded to three digits, 1 of them
    std::ostringstream text;
    text << std::setprecision(3) << in_units << unit;
    return text.str();
  }
  return std::to_string(bytes) + " bytes";
}

std::string some_of(const std::vector<std::string>& names, std::size_t most) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += ", ";
    if (i == most) return text + "...";
    text += names[i];
  }
  return text;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

}  // namespace eventgan
