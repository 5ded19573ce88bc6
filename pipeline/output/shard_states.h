#pragma once

#include <filesystem>
#include <vector>

#include "pipeline/output/output_folder.h"
#include "pipeline/output/shard_state.h"

namespace eventgan {

/// Shards to look at side by side: on a network file system each look is a few waits.
inline constexpr int kLooksAtOnce = 16;

/// What the folder holds of every shard of the plan, in plan order, by shard_state.
std::vector<ShardState> shard_states(const std::filesystem::path& folder,
                                     const FrozenOutline& frozen);

/// The same by proven_shard_state, on all cores: every shard is read.
std::vector<ShardState> proven_shard_states(const std::filesystem::path& folder,
                                            const FrozenOutline& frozen);

}  // namespace eventgan
