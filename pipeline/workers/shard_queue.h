#pragma once

#include <deque>
#include <functional>
#include <vector>

#include "manifests/plan.h"

namespace eventgan {

/// What other workers do with a shard.
enum class ShardActivity {
  kFree,  ///< nothing
  kDone,  ///< one has committed it
  kBusy   ///< one that seems alive is writing it
};

/// The shards a worker has to do, in plan order, looked at again before each: one that another
/// worker has finished meanwhile is skipped, one that another is writing is put off to the end and
/// then made all the same unless it is done by then (those whose writer has given up first). So
/// workers with overlapping parts share the work without talking, and nobody waits for a dead one.
/// Thread safety: one thread at a time.
class ShardQueue {
 public:
  using Look = std::function<ShardActivity(const PlannedShard&)>;

  ShardQueue(std::vector<const PlannedShard*> shards, Look look);

  /// The next shard to make; nullptr at the end, and from then on. Throws what `look` throws.
  const PlannedShard* next();

  /// Shards that others finished before their turn came.
  const std::vector<const PlannedShard*>& done_by_others() const { return done_by_others_; }

 private:
  const PlannedShard* next_deferred();

  std::deque<const PlannedShard*> shards_;
  std::deque<const PlannedShard*> deferred_;
  std::vector<const PlannedShard*> done_by_others_;
  Look look_;
};

}  // namespace eventgan
