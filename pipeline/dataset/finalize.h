#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {

/// What `finalize` found and did.
struct FinalizationReport {
  std::string folder;
  int shards_planned = 0;
  std::vector<ShardState> missing;  ///< those that are not done, in plan order
  DatasetCounts counts;             ///< of the shards that are done
  std::vector<std::string> notes;   ///< on the inputs (see notes_of)
  int views = 0;                    ///< in dataset.h5
  bool written = false;             ///< dataset.h5 and dataset.json are in place
  bool too_many_faults = false;     ///< the limits for quarantined samples are passed

  bool complete() const { return missing.empty(); }
};

/// A line for each missing shard (of very many the first and how many more), then a few on the
/// whole.
std::string to_text(const FinalizationReport& report);

/// One line of JSON.
std::string to_json(const FinalizationReport& report);

struct FinalizationOptions {
  bool partial = false;             ///< write what is done even if shards are missing
  std::optional<ErrorSpec> errors;  ///< limits instead of those of the manifest in the plan
  ShowPhase show_phase{};           ///< of the shards that are read
};

/// Completes the dataset in an output folder: puts back what a retry that was killed has left (see
/// restore_shards), reads every shard of the plan to see that it is what its commit record says,
/// and writes dataset.h5, then dataset.json, which holds the former's hash: after a crash between
/// the two they do not go together, and finalize again puts that right. The same shards give the
/// same bytes, however often. Nothing is written if shards are missing, unless `partial`, or if no
/// shard is done at all.
///
/// Any time, beside workers too: what is not committed is missing. Throws InputError if there is no
/// plan, std::runtime_error naming the file if the disk fails or something is damaged.
FinalizationReport finalize(const std::filesystem::path& folder,
                            const FinalizationOptions& options);

}  // namespace eventgan
