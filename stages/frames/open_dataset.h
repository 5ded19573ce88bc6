#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// Opens the source described by `spec`; relative paths start at `base`, the manifest's folder.
/// Throws InputError if the source's root or an annotation file is missing or unreadable,
/// UsageError if the manifest's keys do not fit what is there.
std::unique_ptr<Dataset> open_dataset(const SourceSpec& spec, const std::filesystem::path& base);

}  // namespace eventgan
