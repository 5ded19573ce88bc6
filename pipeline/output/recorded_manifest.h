#pragma once

#include <filesystem>
#include <optional>

#include "manifests/job_manifest.h"
#include "manifests/plan_outline.h"

namespace eventgan {

/// The job of an output folder, so that its inputs can be read again: the frozen manifest, its
/// paths starting at the folder that run.json records; or, where the inputs have moved, the
/// manifest in `file`. Throws UsageError if there is neither, InputError if `file` cannot be read.
JobManifest recorded_manifest(const std::filesystem::path& folder, const PlanOutline& plan,
                              const std::optional<std::filesystem::path>& file);

}  // namespace eventgan
