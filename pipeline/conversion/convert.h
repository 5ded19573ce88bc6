#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "manifests/job_manifest.h"
#include "pipeline/conversion/conversion_report.h"
#include "pipeline/progress/progress.h"
#include "stages/generator/generator.h"

namespace eventgan {

struct ConversionOptions {
  std::optional<std::filesystem::path> output;  ///< instead of the manifest's
  int threads = 0;                              ///< 0: all cores
  bool overwrite = false;                       ///< discard what an earlier run left in the folder
  /// Called with the number of pairs to do; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
};

/// The job: plans, freezes the plan, converts every shard that is not done, commits each. Shards
/// that an earlier run of the same plan finished are kept.
///
/// The report has `too_many_faults` set if the manifest's limits for quarantined samples were
/// passed. Throws UsageError, InputError, TooManyFaults (policy "fail"), or std::runtime_error when
/// the disk or the generator fails; whole shards stay.
ConversionReport convert(const JobManifest& manifest, const Generator& generator,
                         const std::string& weights_hash, const ConversionOptions& options);

}  // namespace eventgan
