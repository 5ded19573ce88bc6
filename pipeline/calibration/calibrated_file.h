#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "manifests/job_manifest.h"

namespace eventgan {

/// Where calibrated weights go: `out` if it is given; else beside the manifest
/// "FILE-calibrated.safetensors", for the program's own weights
/// "eventgan-WIDTH-calibrated.safetensors", for random ones
/// "untrained-WIDTH-calibrated.safetensors". `base_channels` is the weights' WIDTH.
///
/// Throws UsageError if `out` is not named *.safetensors or its folder is not there, or if the
/// default is the very file that is calibrated: only who names it overwrites it.
std::filesystem::path calibrated_file(const JobManifest& manifest, int base_channels,
                                      const std::optional<std::string>& out);

/// The line for the manifest: "generator": { "weights": "FILE", "precision": "int8" }, FILE
/// relative to the manifest's folder if it lies there or below, else absolute.
std::string calibrated_generator_line(const JobManifest& manifest,
                                      const std::filesystem::path& file);

}  // namespace eventgan
