#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/shard.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {

/// A source of the manifest, as far as an export asks.
struct ExportSource {
  std::string dataset;  ///< "kitti_object"; as the frozen manifest has it, like the split:
  std::string split;    ///< files are named after both
  /// What the names of its samples' files begin with: nothing, unless its split has other sources:
  /// then DATASET and '+', from the second of one kind on DATASET-2 and '+'.
  std::string name_prefix;
  std::string key;  ///< of its draws: source_key
  std::vector<std::string> class_names,
      joint_names;               ///< empty as long as none of its shards is done
  std::string any_shard;         ///< file name of one that is done; empty if none is
  bool has_coco_labels = false;  ///< so that annotations' originals have COCO's ids

  bool has_boxes() const { return !class_names.empty(); }
  bool has_joints() const { return !joint_names.empty(); }
};

/// A shard of the chosen splits.
struct ExportShard {
  ShardOutline outline;
  std::string sha256;
  int valid = 0;
  std::vector<QuarantinedSample> quarantined;
};

/// Shards whose labels fit into one file: of one split, kind of dataset and list of joints, and
/// where asked for of one size.
struct ExportSet {
  /// The split's name; where the split has several sets SPLIT-DATASET, if need be with -HxW, and
  /// with -2, -3 ... behind.
  std::string name;
  std::string split;
  std::vector<const ExportShard*> shards;  ///< in plan order, at least one
};

/// A finalized folder, to be exported. Thread safe.
class ExportInput {
 public:
  /// `splits`: none means all. Throws InputError if the folder is not finalized, its plan or its
  /// sources are others than those of dataset.json, or a shard is missing or another one by now;
  /// UsageError for a split that it does not have.
  ExportInput(const std::filesystem::path& folder, const std::vector<std::string>& splits);

  const std::filesystem::path& folder() const { return folder_; }
  const std::string& name() const { return name_; }
  const std::string& plan_hash() const { return plan_hash_; }
  /// What tells this job from others of its name: a hash of its sources as the manifest names them.
  const std::string& sources_hash() const { return sources_hash_; }
  const std::vector<std::string>& splits() const { return splits_; }  ///< chosen, plan's order
  const std::vector<ExportSource>& sources() const { return sources_; }
  const std::vector<ExportShard>& shards() const { return shards_; }  ///< in plan order
  bool has_recordings() const { return has_recordings_; }             ///< made of a camera's events
  const std::vector<std::string>& missing() const { return missing_; }  ///< finalize --partial

  const ExportSource& source_of(const ExportShard& shard) const {
    return sources_.at(static_cast<std::size_t>(shard.outline.source));
  }

  /// Opens a shard, which is hashed before the first time: throws InputError if it is not the one
  /// that was finalized.
  ShardReader open(const ExportShard& shard) const;

  /// Of all sources with joints, those of other splits too, in the manifest's order: what their
  /// shards say of them, each list of joints once. Throws as ShardReader does.
  std::vector<LabelSchema> joint_schemas() const;

  /// The sets of the shards whose source has joints, or, `joints_only` not given, of all.
  std::vector<ExportSet> sets(bool joints_only, bool by_size) const;

 private:
  void read_description(const std::vector<std::string>& splits);
  void name_sources();

  std::filesystem::path folder_;
  std::string name_, plan_hash_, sources_hash_;
  std::vector<std::string> splits_, missing_;
  std::vector<ExportSource> sources_;
  std::vector<ExportShard> shards_;
  bool has_recordings_ = false;
  mutable std::mutex mutex_;
  mutable std::set<std::string> hashed_;
};

}  // namespace eventgan
