#pragma once

#include <functional>
#include <iosfwd>
#include <string>

#include "manifests/plan_outline.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Reads plan.json, whose layout is fixed, line by line:
///
///   {"fingerprint":{...},
///   "format":"eventgan-plan",
///   "manifest":"...",
///   "name":"...",
///   "shards":[
///   {"height":H,"name":"...","samples":[
///   {...},                                one line a sample, none but the last without comma
///   {...}
///   ],"source":S,"width":W},              likewise
///   ...
///   ],
///   "sources":[...],
///   "version":1}
///
/// Each sample goes to `take_sample` with its shard's index, in order; if that is empty, samples
/// are counted but not parsed. Throws std::runtime_error for the first line that is damaged (see
/// read_plan).
PlanOutline read_plan_lines(
    std::istream& stream, const std::string& name,
    const std::function<void(std::size_t shard, const StrictValue& sample)>& take_sample);

}  // namespace eventgan
