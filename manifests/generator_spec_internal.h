#pragma once

#include "manifests/job_manifest.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Reads the manifest's `generator`; which keys it may have depends on its kind.
GeneratorSpec read_generator(const StrictValue& value);

}  // namespace eventgan
