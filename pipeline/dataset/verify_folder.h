#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {

struct VerifyOptions {
  bool deep = false;  ///< compare labels with the sources, too
  /// deep: the job's manifest, if its folder is not the recorded one.
  std::optional<std::filesystem::path> manifest;
  ShowPhase show_phase{};  ///< of the shards that are read and compared
};

/// What was done with one shard of the plan.
struct ShardCheck {
  std::string name;
  ShardCondition condition = ShardCondition::kMissing;
  std::int64_t size_bytes = 0;      ///< of a file that was hashed and read
  int samples = 0;                  ///< by its commit record
  int quarantined = 0;              ///< of these
  long long compared = 0;           ///< deep: valid samples compared with their source
  std::vector<std::string> faults;  ///< among those of the folder
};

/// What `eventgan verify` found.
struct FolderCheck {
  std::vector<std::string> faults;   ///< one line each, "PATH: expected X, got Y"
  std::vector<std::string> notes;    ///< what is no fault, but a person should know
  std::vector<ShardCheck> by_shard;  ///< in plan order
  long long samples = 0;
  long long valid = 0;
  long long compared = 0;  ///< deep: valid samples whose labels were compared with their source

  int shards() const { return static_cast<int>(by_shard.size()); }
  bool sound() const { return faults.empty(); }
};

/// What `eventgan verify` prints: a line for each note, for each shard what was done with it and
/// its faults, the other faults, and the sum. `deep` as in VerifyOptions.
std::string to_text(const FolderCheck& check, bool deep);

/// The same as JSON; `folder` is the one that was checked.
std::string to_json(const FolderCheck& check, const std::filesystem::path& folder);

/// Checks a whole output folder: the plan, a commit record for every shard of it, each shard's
/// bytes, structure, counts, checksums and values, on all cores; that nothing else looks like a
/// part of it; that dataset.json and dataset.h5, if there, are what the commit records give.
/// Temporaries of other processes are noted. With `deep`, labels are compared with the sources,
/// where these are there (see SourceComparison). Changes nothing. Throws InputError if the folder
/// has no plan, std::runtime_error if that is damaged.
FolderCheck verify_folder(const std::filesystem::path& folder, const VerifyOptions& options = {});

/// A line "PATH: expected X, got Y" for each .h5 or .json file of an output folder (not below it)
/// that is neither of the plan nor one the program keeps beside it: a reader that takes all of them
/// would take it for a part of the dataset. A job manifest is none. Sorted.
std::vector<std::string> stray_files(const std::filesystem::path& folder, const PlanOutline& plan);

/// What is wrong with dataset.json and dataset.h5 of an output folder: that they are not what
/// `finalize` makes of the plan and the commit records, or do not go together. Lines "PATH:
/// expected X, got Y"; none if they are sound, or neither is there. `shards` as read_dataset_parts
/// takes them: none is opened that was not found sound.
std::vector<std::string> dataset_faults(const std::filesystem::path& folder, FrozenOutline frozen,
                                        std::vector<ShardState> shards);

}  // namespace eventgan
