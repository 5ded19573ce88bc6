#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "manifests/simulation_manifest.h"
#include "pipeline/progress/progress.h"
#include "pipeline/simulation/simulation_report.h"

namespace eventgan {

struct SimulationOptions {
  std::optional<std::filesystem::path> output;  ///< instead of the manifest's
  int threads = 0;                              ///< 0: all cores
  bool overwrite = false;                       ///< make anew what is there
  /// Called with the number of frames to do; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
};

/// The job: makes every recording of the manifest that is not there yet, sources in parallel. A
/// recording is there when a file of its name is: files appear whole. All random numbers come from
/// the manifest's seed and the recording's name, so neither threads nor other sources change it.
///
/// Throws UsageError if a recording on disk was made with other settings, InputError if a clip
/// cannot be read, std::runtime_error if the disk fails; whole recordings stay.
SimulationReport simulate(const SimulationManifest& manifest, const SimulationOptions& options);

}  // namespace eventgan
