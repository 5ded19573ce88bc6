#include "manifests/values/job.h"

#include <algorithm>
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

std::int64_t most_quarantined(const ErrorSpec& errors, std::int64_t planned) {
  constexpr std::int64_t kFewest = 100;  // samples of which a share of 1 % is a whole one
  if (errors.policy == ErrorPolicy::kFail) return 0;
  auto most = static_cast<std::int64_t>(errors.max_fraction * static_cast<double>(planned));
  if (planned > 1 && planned < kFewest && errors.max_fraction > 0)
    most = std::max<std::int64_t>(most, 1);
  return std::min(most, errors.max_count);
}

bool beyond_limits(const ErrorSpec& errors, std::int64_t quarantined, std::int64_t planned) {
  return quarantined > most_quarantined(errors, planned);
}

std::string limits_text(const ErrorSpec& errors, std::int64_t planned) {
  if (errors.policy == ErrorPolicy::kFail) {
    return "no quarantined pair (errors.policy in the manifest is \"fail\")";
  }
  return "at most " + count_text(most_quarantined(errors, planned), "quarantined pair") +
         " (errors in the manifest)";
}

}  // namespace eventgan
