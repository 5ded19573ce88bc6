#include "pipeline/output/shard_states.h"

#include "pipeline/threads/for_each_index.h"
#include "pipeline/threads/thread_count.h"

namespace eventgan {

std::vector<ShardState> shard_states(const std::filesystem::path& folder,
                                     const FrozenOutline& frozen) {
  std::vector<ShardState> states(frozen.plan.shards.size());
  for_each_index(states.size(), kLooksAtOnce, [&](std::size_t i) {
    states[i] = shard_state(folder, frozen.plan.shards[i], frozen.hash);
  });
  return states;
}

std::vector<ShardState> proven_shard_states(const std::filesystem::path& folder,
                                            const FrozenOutline& frozen) {
  std::vector<ShardState> states(frozen.plan.shards.size());
  for_each_index(states.size(), thread_count(0), [&](std::size_t i) {
    states[i] = proven_shard_state(folder, frozen.plan.shards[i], frozen.hash);
  });
  return states;
}

}  // namespace eventgan
