#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "manifests/job_manifest.h"
#include "pipeline/conversion/conversion_report.h"
#include "pipeline/profile/trace_recorder.h"
#include "pipeline/progress/progress.h"
#include "pipeline/workers/shard_part.h"
#include "stages/generator/generator.h"

namespace eventgan {

struct ConversionOptions {
  std::optional<std::filesystem::path> output;  ///< instead of the manifest's
  int threads = 0;                              ///< 0: all cores
  bool overwrite = false;                       ///< discard what an earlier run left in the folder
  ShardPart part;                               ///< this worker's shards
  double grace_s = 20;                          ///< time after a request to stop, ≥ 0
  /// Seconds since the request to stop, if one has come (see StopSignal); called from several
  /// threads. None: nobody asks.
  std::function<std::optional<double>()> since_stop_request;
  /// Called with the number of pairs to do; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
  /// Told what a person should know: shards that are made again. None: silent.
  std::function<void(const std::string&)> warn;
  /// Told what goes on: which part this is, that checking takes long. None: silent.
  std::function<void(const std::string&)> note;
  TraceRecorder* trace = nullptr;  ///< of every stage and thread; null: nobody asks
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
