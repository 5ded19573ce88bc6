#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/values/job.h"

namespace eventgan {

/// Reads a manifest. Throws UsageError listing *every* fault, one per line as
/// "PATH: $.json.path: expected X, got Y"; InputError if the file cannot be read.
JobManifest read_job_manifest(const std::filesystem::path& file);

/// The same from text; `name` stands for the file in messages. `directory` is made absolute.
JobManifest parse_job_manifest(std::string_view text, const std::filesystem::path& directory,
                               const std::string& name);

/// What of a manifest makes a volume of two images: `seed`, `image`, `generator` (on the processor,
/// not "events") and `volume`. Each may be missing; images without a preset are prepared as those
/// of dataset "frames". Throws as above.
JobManifest parse_pair_manifest(std::string_view text, const std::filesystem::path& directory,
                                const std::string& name);

}  // namespace eventgan
