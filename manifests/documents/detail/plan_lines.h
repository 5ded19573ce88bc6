#pragma once

#include <functional>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "manifests/documents/plan.h"
#include "manifests/documents/strict_json.h"

namespace eventgan {

// The parts of plan.json that are JSON values of their own. plan_lines.cc knows how they are laid
// out; both ways of a part are together.

inline constexpr char kPlanFormat[] = "eventgan-plan";
inline constexpr FormatVersion kPlanVersion{1, 0};

nlohmann::json to_json_value(const PlannedSample& sample);
PlannedSample read_planned_sample(const StrictValue& value);

nlohmann::json to_json_value(const SourceSummary& source);
SourceSummary read_source_summary(const StrictValue& value);

/// Reads plan.json, whose layout is fixed, line by line:
///
///   {"format":"eventgan-plan","version":"1.0",
///   "fingerprint":{...},
///   "manifest":"...",
///   "name":"...",
///   "shards":[
///   {"height":H,"name":"...","samples":[
///   {...},                                one line a sample, none but the last without comma
///   {...}
///   ],"source":S,"width":W},              likewise
///   ...
///   ],
///   "sources":[...]}
///
/// A later minor version may have keys beside these, the outermost in lines of their own before one
/// of these.
///
/// Each sample goes to `take_sample` with its shard's index, in order; if that is empty, samples
/// are counted but not parsed. Throws std::runtime_error for the first line that is damaged (see
/// read_plan).
PlanOutline read_plan_lines(
    std::istream& stream, const std::string& name,
    const std::function<void(std::size_t shard, const StrictValue& sample)>& take_sample);

}  // namespace eventgan
