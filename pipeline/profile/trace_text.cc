#include "pipeline/profile/trace_text.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {

std::string trace_string(std::string_view text) { return dump_json(nlohmann::json(text)); }

std::string trace_microseconds(std::int64_t nanoseconds) {
  char text[32];
  std::snprintf(text, sizeof text, "%lld.%03d", static_cast<long long>(nanoseconds / 1000),
                static_cast<int>(nanoseconds % 1000));
  return text;
}

}  // namespace eventgan
