#pragma once

#include <nlohmann/json_fwd.hpp>

#include "manifests/plan.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

// The parts of plan.json that are JSON values of their own. plan_lines.cc knows how they are laid
// out; both ways of a part stand together.

inline constexpr char kPlanFormat[] = "eventgan-plan";
inline constexpr int kPlanVersion = 1;

nlohmann::json to_json_value(const PlannedSample& sample);
PlannedSample read_planned_sample(const StrictValue& value);

nlohmann::json to_json_value(const SourceSummary& source);
SourceSummary read_source_summary(const StrictValue& value);

}  // namespace eventgan
