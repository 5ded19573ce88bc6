#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "manifests/values/shard.h"
#include "pipeline/conversion/conversion_run.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/folder/output_folder.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// Where an output folder has quarantined samples, by its commit records alone.
struct QuarantinedSamples {
  std::vector<std::size_t> shards;   ///< committed shards with any, by their place in the plan
  std::int64_t count = 0;            ///< in all of them
  std::vector<std::string> ids;      ///< of these samples, in plan order
  std::vector<std::string> damaged;  ///< "PATH: expected X, got Y" of shards that are not whole
  int shards_missing = 0;            ///< not made yet
};

QuarantinedSamples find_quarantined(const std::filesystem::path& folder,
                                    const FrozenOutline& frozen);

/// What to redo of each shard: the planned shard with its quarantined samples alone, in the order
/// of its commit record, which says the slot of each.
std::vector<PlannedShard> plan_retry(const std::vector<CommittedShard>& shards);

/// What a retry did.
struct RetryReport {
  std::string folder;
  std::int64_t planned = 0;             ///< samples of the whole plan
  std::int64_t tried = 0;               ///< in committed shards or found to fail again
  std::int64_t mended = 0;              ///< of these, in committed shards
  std::vector<QuarantinedSlot> failed;  ///< the others: tried again and failed again
  std::int64_t quarantined = 0;         ///< samples that are quarantined now, tried or not
  int shards_rewritten = 0;
  int shards_renamed = 0;  ///< that have classes more, which their source's labels have gained
  std::vector<std::string> damaged_shards;  ///< "PATH: expected X, got Y": left to `convert`
  int shards_missing = 0;                   ///< not made yet: left to `convert`
  /// Fields of the fingerprint in which the inputs have changed since the plan was frozen, or since
  /// the last retry: recorded, so that `convert` goes on.
  std::vector<std::string> changed_inputs;
  std::vector<std::string> notes;  ///< of mended samples: boxes that labels lost, outlines
  bool stopped = false;            ///< a request to stop came before all were tried, or renamed
  bool too_many_faults = false;    ///< the manifest's limits are passed still
  bool dataset_outdated = false;   ///< dataset.json and dataset.h5 were removed (outdate_dataset)
  double wall_seconds = 0;
};

/// A few lines for a person; samples that failed again are listed up to a number, then counted.
std::string to_text(const RetryReport& report);

/// One line of JSON.
std::string to_json(const RetryReport& report);

/// The report where no committed shard of the folder has a quarantined sample; none if one has, or
/// if labels have gained classes.
/// First cleans up what a retry that was killed has left (see restore_shards). Inputs that have
/// changed are recorded all the same (see retry): without that `convert` would not go on. No
/// generator is needed, nor the machine that converts: weights, engine, processor and libraries are
/// left to `convert` to compare. Throws as retry does.
std::optional<RetryReport> nothing_to_retry(const std::filesystem::path& folder,
                                            const FrozenOutline& frozen,
                                            const JobManifest& manifest, const RunOptions& options);

/// Redoes the quarantined samples of an output folder's committed shards, after its inputs were
/// mended; the other samples stay as they are, and plan.json does. Classes keep their numbers;
/// where a source's labels have gained some, all its committed shards get their names first, behind
/// those they have (number_classes). Else a shard is written again only
/// if a sample of it is mended now or fails for another reason. Shards that are damaged, or not
/// made yet, are left to `convert`. A shard whose size was unknown at planning gets that of its
/// mended images with its first good sample (see complete_plan).
///
/// The job must be the frozen one in all but its inputs: where the fingerprint differs in fields
/// that may change, that is recorded first (amendments.json), so that later runs accept the folder.
/// One retry at a time: it holds the lock of plan.json (FileLock). Throws UsageError listing the
/// other fields that differ, InputError where the labels' numbers mean others
/// (Dataset::label_meanings), Stopped on a request to stop while it plans, or
/// std::runtime_error when another retry is at work, another process has put a shard in place
/// meanwhile, or the disk or the generator fails; whole shards stay.
RetryReport retry(const std::filesystem::path& folder, const JobManifest& manifest,
                  const Generator& generator, const std::string& weights_hash,
                  const RunOptions& options);

}  // namespace eventgan
