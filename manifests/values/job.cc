#include "manifests/values/job.h"

#include <sstream>
#include <stdexcept>

#include "manifests/values/text.h"

namespace eventgan {

std::size_t stored_size(StoredType type) {
  switch (type) {
    case StoredType::kFloat32:
      return 4;
    case StoredType::kFloat16:
      return 2;
    case StoredType::kUint8:
      return 1;
  }
  throw std::logic_error("unknown stored type");
}

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
  text << "at most " << count_text(errors.max_count, "quarantined pair") << " and a share of "
       << errors.max_fraction << " (errors in the manifest)";
  return text.str();
}

}  // namespace eventgan
