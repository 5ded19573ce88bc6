#pragma once

#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Reads one of the manifest's sources.
SourceSpec read_source(const StrictValue& value);

/// Reads a source's `pairs`.
PairSpec read_pairs(const StrictValue& value);

/// Reads gaps, 1..6, each once, even with kAround; ascending, whatever order they are written in.
std::vector<int> read_gaps(const StrictValue& value, PairSide side);

}  // namespace eventgan
