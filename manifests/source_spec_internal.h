#pragma once

#include "manifests/job_manifest.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Reads one of the manifest's sources.
SourceSpec read_source(const StrictValue& value);

/// Reads a source's `pairs`.
PairSpec read_pairs(const StrictValue& value);

}  // namespace eventgan
