#pragma once

#include "manifests/values/job.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan::testing {

/// A job over a clip of `frames` flat images of 30x20 in FOLDER/clip, each 20 grey levels
/// brighter than the one before; gap 1, four samples a shard, float16. The manifest's text is a
/// true manifest of the job.
JobManifest make_small_job(const TemporaryFolder& folder, int frames);

}  // namespace eventgan::testing
