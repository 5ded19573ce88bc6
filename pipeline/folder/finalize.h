#pragma once

#include <filesystem>
#include <optional>

#include "manifests/job_manifest.h"
#include "pipeline/folder/finalization_report.h"

namespace eventgan {

struct FinalizationOptions {
  bool partial = false;             ///< write what there is even if shards are missing
  std::optional<ErrorSpec> errors;  ///< limits instead of those of the manifest in the plan
};

/// Completes the dataset in an output folder: puts back what a retry that was killed has left (see
/// restore_shards), reads every shard of the plan to see that it is what its marker says, and
/// writes dataset.h5, then dataset.json, which holds the former's hash: after a crash between the
/// two they do not go together, and finalize again puts that right. The same shards give the same
/// bytes, however often. Nothing is written if shards are missing, unless `partial`, or if no shard
/// is done at all.
///
/// Any time, beside workers too: what is not committed is missing. Throws InputError if there is no
/// plan, std::runtime_error naming the file if the disk fails or something is damaged.
FinalizationReport finalize(const std::filesystem::path& folder,
                            const FinalizationOptions& options);

}  // namespace eventgan
