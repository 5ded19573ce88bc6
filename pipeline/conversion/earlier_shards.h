#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "manifests/values/shard.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"

namespace eventgan {

/// A shard with its commit record in place.
struct CommittedShard {
  const PlannedShard* shard = nullptr;
  CommitRecord record;
};

/// What earlier runs left of some shards, in plan order.
struct EarlierShards {
  std::vector<CommittedShard> done;
  std::vector<const PlannedShard*> left;  ///< to be made, or made again
  std::vector<std::string> faults;        ///< "PATH: expected X, got Y": why some are made again
  /// Names of shards that only the look at their bytes told of; with the commit record's text where
  /// that is what is wrong, else empty.
  std::map<std::string, std::string> distrusted;
};

/// Looks at what the folder holds of `shards` of the plan. Those that are committed are hashed, and
/// their commit records compared with them, before they are trusted (ScanDepth::kRows).
EarlierShards check_earlier_shards(const std::filesystem::path& folder, const FrozenPlan& frozen,
                                   const std::vector<const PlannedShard*>& shards,
                                   const ScanOptions& options);

/// Quarantined samples of those `shards` that are done, by their commit records alone.
std::int64_t count_quarantined(const std::filesystem::path& folder, const FrozenPlan& frozen,
                               const std::vector<const PlannedShard*>& shards,
                               const ScanOptions& options);

}  // namespace eventgan
