#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {

// What completes a dataset: pipeline/dataset writes both.
inline constexpr char kDescriptionName[] = "dataset.json";
inline constexpr char kViewName[] = "dataset.h5";

/// A plan as it is in an output folder.
struct FrozenPlan {
  Plan plan;
  std::string hash;  ///< SHA-256 of plan.json, hex
};

/// The same without its samples: small and quick to read for any number of pairs.
struct FrozenOutline {
  PlanOutline plan;
  std::string hash;  ///< SHA-256 of plan.json, hex
};

/// Freezes `plan` as FOLDER/plan.json, created whole and only if absent; written piece by piece, so
/// that its text is never in memory as a whole. If a plan is there already (from an earlier run, or
/// a process that was faster) it is taken, provided its fingerprint, with the folder's amendments,
/// is the same. Throws UsageError listing the fields that differ otherwise, or if the same
/// fingerprint has another plan; std::runtime_error if the one that is there is damaged, or on an
/// error of writing, after which there is no plan.json. Safe in several processes and threads at
/// once. `manifest_folder` is where the plan's relative paths start: it decides nothing but the
/// advice.
FrozenPlan freeze_plan(const std::filesystem::path& folder, Plan plan,
                       const ShowPhase& show_phase = {},
                       const std::filesystem::path& manifest_folder = {});

/// The plan of an output folder. Throws InputError if there is none, std::runtime_error if it is
/// damaged.
FrozenPlan read_frozen_plan(const std::filesystem::path& folder);
FrozenOutline read_frozen_outline(const std::filesystem::path& folder);

/// Throws UsageError if a person's file has the name of one that a job writes or removes in the
/// folder, beside its shards: to be asked before anything is written. The same of a shard's name
/// and that of its commit record.
void require_own_results(const std::filesystem::path& folder);
void require_own_shard(const std::filesystem::path& folder, const std::string& shard);

/// Makes room for the job that has this fingerprint, its relative paths starting at
/// `manifest_folder`: deletes plan.json, every shard and commit record it names, and what was made
/// from these (dataset.json, dataset.h5, report.html, amendments.json); other files stay. None
/// without a plan. Throws UsageError, and deletes nothing, if the plan is of another job, whose
/// shards this one would not make again: of another name, or of other labelled frames (another
/// source, folder, annotation, split or selection); or if it is of a whole job, and this one is a
/// trial.
void discard_output(const std::filesystem::path& folder,
                    const std::map<std::string, std::string>& fingerprint,
                    const std::filesystem::path& manifest_folder);

/// For a shard that is about to be put in place of another one: removes dataset.json and dataset.h5
/// if they name it (or are damaged), since the view's places within the shard, of boxes and joints,
/// are those of the former one. Whether they were there. Files that are not the program's stay, and
/// those that name the shard with the SHA-256 `up_to_date`.
bool outdate_dataset(const std::filesystem::path& folder, const std::string& shard,
                     const std::string& up_to_date = "");

/// FOLDER/run.json says where the manifest was, so that `preview` finds the frames. It is a
/// convenience, not part of the plan. One that is damaged, or has another than an absolute path, is
/// as none.
void record_manifest_folder(const std::filesystem::path& folder, const JobManifest& manifest);
std::optional<std::filesystem::path> recorded_manifest_folder(const std::filesystem::path& folder);

/// The job of an output folder, so that its inputs can be read again: the frozen manifest, its
/// paths starting at the folder that run.json records; or, where the inputs have moved, the
/// manifest in `file`. Throws UsageError if there is neither, InputError if `file` cannot be read.
JobManifest recorded_manifest(const std::filesystem::path& folder, const PlanOutline& plan,
                              const std::optional<std::filesystem::path>& file);

}  // namespace eventgan
