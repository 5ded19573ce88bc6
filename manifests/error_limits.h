#pragma once

#include <cstdint>
#include <string>

#include "manifests/job_manifest.h"

namespace eventgan {

/// True if so many of a plan's samples are quarantined that its error policy calls the run failed.
bool beyond_limits(const ErrorSpec& errors, std::int64_t quarantined, std::int64_t planned);

/// What the policy allows, for "expected ..., got ...".
std::string limits_text(const ErrorSpec& errors);

}  // namespace eventgan
