#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "manifests/job_manifest.h"
#include "pipeline/conversion/conversion_run.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/retry/retry_report.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// The report where no committed shard of the folder has a quarantined sample; none if one has.
/// First cleans up what a retry that was killed has left (see restore_shards). Inputs that have
/// changed are recorded all the same (see retry): without that `convert` would not go on. No
/// generator is needed, nor the machine that converts: weights, engine, processor and libraries are
/// left to `convert` to compare. Throws as retry does.
std::optional<RetryReport> nothing_to_retry(const std::filesystem::path& folder,
                                            const FrozenOutline& frozen,
                                            const JobManifest& manifest, const RunOptions& options);

/// Redoes the quarantined samples of an output folder's committed shards, after its inputs were
/// mended; every other byte of the shards stays, and plan.json does. A shard is written again only
/// if a sample of it is mended now or fails for another reason. Shards that are damaged, or not
/// made yet, are left to `convert`. A shard whose size was unknown at planning gets that of its
/// mended pictures with its first good sample (see complete_plan).
///
/// The job must be the frozen one in all but its inputs: where the fingerprint differs in fields
/// that may change, that is recorded first (amendments.json), so that later runs accept the folder.
/// Throws UsageError listing the other fields that differ, InputError, Stopped on a request to stop
/// while it plans, or std::runtime_error when the disk or the generator fails; whole shards stay.
RetryReport retry(const std::filesystem::path& folder, const JobManifest& manifest,
                  const Generator& generator, const std::string& weights_hash,
                  const RunOptions& options);

}  // namespace eventgan
