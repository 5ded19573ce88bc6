#include "pipeline/workers/shard_queue.h"

#include <utility>

namespace eventgan {

ShardQueue::ShardQueue(std::vector<const PlannedShard*> shards, Look look)
    : shards_(shards.begin(), shards.end()), look_(std::move(look)) {}

const PlannedShard* ShardQueue::next() {
  while (!shards_.empty()) {
    const PlannedShard* shard = shards_.front();
    const ShardActivity activity = look_(*shard);
    shards_.pop_front();
    if (activity == ShardActivity::kFree) return shard;
    if (activity == ShardActivity::kDone) done_by_others_.push_back(shard);
    if (activity == ShardActivity::kBusy) deferred_.push_back(shard);
  }
  return next_deferred();
}

const PlannedShard* ShardQueue::next_deferred() {
  for (auto at = deferred_.begin(); at != deferred_.end();) {
    const PlannedShard* shard = *at;
    const ShardActivity activity = look_(*shard);
    if (activity == ShardActivity::kBusy) {
      ++at;
      continue;
    }
    at = deferred_.erase(at);
    if (activity == ShardActivity::kFree) return shard;
    done_by_others_.push_back(shard);
  }
  if (deferred_.empty()) return nullptr;
  // Rather one shard made twice than one waited for: its writer may be dead without a sign.
  const PlannedShard* shard = deferred_.front();
  deferred_.pop_front();
  return shard;
}

}  // namespace eventgan
