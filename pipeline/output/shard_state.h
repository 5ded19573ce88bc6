#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "manifests/marker.h"
#include "manifests/plan_outline.h"

namespace eventgan {

/// What an output folder holds of a planned shard.
enum class ShardCondition {
  kDone,           ///< the marker parses, is of this plan, and the shard has its size
  kMissing,        ///< neither shard nor marker
  kUncommitted,    ///< a shard without a marker: its writer ended between the two
  kNoShard,        ///< a marker without a shard
  kTornMarker,     ///< the marker does not parse
  kForeignMarker,  ///< the marker is of another plan or another shard
  kOtherSize,      ///< the shard has not the marker's size
  kOtherBytes,     ///< the shard has not the marker's SHA-256
  kOtherCounts     ///< the shard is the marker's, but not what the marker says of its rows
};

/// Short words for a person: "done", "missing", "not committed", ...
const char* to_string(ShardCondition condition);

struct ShardState {
  ShardCondition condition = ShardCondition::kMissing;
  std::optional<ShardMarker> marker;  ///< kDone: the shard's
  std::string fault;                  ///< "PATH: expected X, got Y"; empty for kDone and kMissing

  bool done() const { return condition == ShardCondition::kDone; }
};

/// Looks at one shard of the plan with hash `plan_hash`, by names, sizes and the marker alone
/// (DESIGN section 6). Never throws for what stands in the folder. Thread safe.
ShardState shard_state(const std::filesystem::path& folder, const ShardOutline& shard,
                       const std::string& plan_hash);

/// The same, and the shard's bytes are hashed: may find kOtherBytes.
ShardState hashed_shard_state(const std::filesystem::path& folder, const ShardOutline& shard,
                              const std::string& plan_hash);

/// The same, and then what the marker says of the rows is compared with the shard: may find
/// kOtherCounts. HDF5 opens the shard only if its bytes are the marker's: it does not promise to
/// survive others. Nothing else may use HDF5 meanwhile but this and ShardReaders.
ShardState proven_shard_state(const std::filesystem::path& folder, const ShardOutline& shard,
                              const std::string& plan_hash);

}  // namespace eventgan
