#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "manifests/job_manifest.h"
#include "manifests/marker.h"
#include "manifests/plan.h"

namespace eventgan {

/// A plan as it stands in an output folder.
struct FrozenPlan {
  Plan plan;
  std::string hash;  ///< SHA-256 of plan.json, hex
};

/// Freezes `plan` as FOLDER/plan.json, created whole and only if absent. If a plan is there already
/// (from an earlier run, or a process that was faster) it is taken, provided its fingerprint is the
/// same. Throws UsageError listing the fields that differ otherwise.
FrozenPlan freeze_plan(const std::filesystem::path& folder, const Plan& plan);

/// The plan of an output folder. Throws InputError if there is none, std::runtime_error if it is
/// damaged.
FrozenPlan read_frozen_plan(const std::filesystem::path& folder);

/// Deletes plan.json and every shard and marker it names; other files are left alone. Nothing
/// happens without plan.json.
void discard_output(const std::filesystem::path& folder);

/// The marker of a shard that is done: the marker parses, names the plan, and the file has its
/// size. None if the shard is still to be made.
std::optional<ShardMarker> done_marker(const std::filesystem::path& folder,
                                       const PlannedShard& shard, const std::string& plan_hash);

/// FOLDER/run.json says where the manifest was, so that `preview` finds the frames. It is a
/// convenience, not part of the plan.
void record_manifest_folder(const std::filesystem::path& folder, const JobManifest& manifest);
std::optional<std::filesystem::path> recorded_manifest_folder(const std::filesystem::path& folder);

}  // namespace eventgan
