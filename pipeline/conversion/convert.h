#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "manifests/values/job.h"
#include "pipeline/conversion/conversion_report.h"
#include "pipeline/conversion/conversion_run.h"
#include "pipeline/conversion/worker_part.h"
#include "stages/generator/generator.h"

namespace eventgan {

struct ConversionOptions : RunOptions {
  std::optional<std::filesystem::path> output;  ///< instead of the manifest's
  bool overwrite = false;                       ///< discard what an earlier run of this job left
  WorkerPart part;                              ///< this worker's shards
  std::optional<std::int64_t> limit;            ///< a trial of so many pairs (PlanningOptions)
  /// Told what goes on: which part this is, where the manifest is now. None: silent.
  std::function<void(const std::string&)> note;
  /// Called once the job is planned, when nothing is written yet. None: nothing.
  std::function<void()> on_planned;
};

/// The job: plans, freezes the plan, converts every shard of this worker's part that is not done,
/// commits each. Committed shards are hashed and then kept; those that prove damaged are made
/// again. Any number of workers may share the folder; what another has done meanwhile is not done
/// again (see ShardQueue).
///
/// On a request to stop it finishes the shard under way within the grace period or drops it (see
/// stop_order), and ends. While it plans, it ends with Stopped, and nothing is written.
///
/// The report has `too_many_faults` set if the manifest's limits for quarantined samples were
/// passed. Throws UsageError, InputError, TooManyFaults (policy "fail"), or std::runtime_error when
/// the disk or the generator fails; whole shards stay, and nothing else.
ConversionReport convert(const JobManifest& manifest, const Generator& generator,
                         const std::string& weights_hash, const ConversionOptions& options);

}  // namespace eventgan
