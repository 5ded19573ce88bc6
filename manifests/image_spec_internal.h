#pragma once

#include "manifests/job_manifest.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Reads the manifest's `image`; the preset, if one is named, fills in `grey` and `blur`.
ImageSpec read_image(const StrictValue& value);

}  // namespace eventgan
