#include "manifests/error_limits.h"

#include <fmt/core.h>

namespace eventgan {

bool beyond_limits(const ErrorSpec& errors, std::int64_t quarantined, std::int64_t planned) {
  if (errors.policy == ErrorPolicy::kFail) return quarantined > 0;
  return quarantined > errors.max_count ||
         static_cast<double>(quarantined) > errors.max_fraction * static_cast<double>(planned);
}

std::string limits_text(const ErrorSpec& errors) {
  if (errors.policy == ErrorPolicy::kFail) {
    return "no quarantined pair (errors.policy in the manifest is \"fail\")";
  }
  return fmt::format("at most {} quarantined pairs and {:g} of all (errors in the manifest)",
                     errors.max_count, errors.max_fraction);
}

}  // namespace eventgan
