#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/testing/text_file.h"

namespace eventgan::testing {

inline nlohmann::json read_trace(const std::filesystem::path& file) {
  return nlohmann::json::parse(read_file(file));
}

/// Events of one phase ("X", "M", "C") and, unless empty, one name.
inline std::vector<nlohmann::json> events(const nlohmann::json& trace, const std::string& phase,
                                          const std::string& name = "") {
  std::vector<nlohmann::json> found;
  for (const auto& event : trace.at("traceEvents")) {
    if (event.at("ph") == phase && (name.empty() || event.at("name") == name))
      found.push_back(event);
  }
  return found;
}

/// A time of an event in nanoseconds.
inline std::int64_t nanoseconds(const nlohmann::json& event, const char* field) {
  return std::llround(1000 * event.at(field).get<double>());
}

}  // namespace eventgan::testing
