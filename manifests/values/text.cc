#include "manifests/values/text.h"

#include <iomanip>

namespace eventgan {

std::string count_text(std::int64_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
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

}  // namespace eventgan
