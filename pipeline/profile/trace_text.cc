#include "pipeline/profile/trace_text.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {

std::string trace_string(std::string_view text) { return dump_json(nlohmann::json(text)); }

std::string trace_microseconds(std::int64_t nanoseconds) {
  return fmt::format("{}.{:03}", nanoseconds / 1000, nanoseconds % 1000);
}

}  // namespace eventgan
