#include "manifests/error_limits.h"

#include <sstream>

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
  std::ostringstream text;
  text << "at most " << errors.max_count << " quarantined pairs and " << errors.max_fraction
       << " of all (errors in the manifest)";
  return text.str();
}

}  // namespace eventgan
