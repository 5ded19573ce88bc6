#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "manifests/marker.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/profile/trace_recorder.h"

namespace eventgan {

/// A shard with its marker in place.
struct CommittedShard {
  const PlannedShard* shard = nullptr;
  ShardMarker marker;
};

/// What earlier runs left of some shards, in plan order.
struct EarlierShards {
  std::vector<CommittedShard> done;
  std::vector<const PlannedShard*> left;  ///< to be made, or made again
  std::vector<std::string> faults;        ///< "PATH: expected X, got Y": why some are made again
  /// Names of shards that only the look at their bytes told of; with the marker's text where that
  /// is what is wrong, else empty.
  std::map<std::string, std::string> distrusted;
};

struct EarlierCheck {
  int threads = 1;
  std::function<bool()> stop;  ///< asked between shards; true leaves those not looked at yet out
  /// Told before it takes long.
  std::function<void(const std::string&)> note;
  TraceRecorder* trace = nullptr;  ///< of the hashing; null: nobody asks
};

/// Looks at what the folder holds of `shards` of the plan. Those that are committed are hashed, and
/// their markers compared with them, before they are trusted (see proven_shard_state).
EarlierShards check_earlier_shards(const std::filesystem::path& folder, const FrozenPlan& frozen,
                                   const std::vector<const PlannedShard*>& shards,
                                   const EarlierCheck& check);

/// Quarantined samples of those `shards` that are done, by their markers alone.
std::int64_t count_quarantined(const std::filesystem::path& folder, const FrozenPlan& frozen,
                               const std::vector<const PlannedShard*>& shards,
                               const EarlierCheck& check);

}  // namespace eventgan
