#pragma once

#include <chrono>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"

namespace eventgan {

/// What other workers do with a shard.
enum class ShardActivity {
  kFree,  ///< nothing
  kDone,  ///< one has committed it
  kBusy   ///< one that seems alive is writing it
};

/// The output folder as several workers share it, who know of each other by files alone. A shard
/// that this worker takes is claimed at once by a temporary file, since the samples of the shard
/// before may keep its writer from opening it for long; else two workers side by side would make
/// the same shards for ever. While the shard is written, the file says in decimal how many samples
/// it has, every two seconds, for `status`: a job that is done sooner writes nothing else. Thread
/// safe.
class SharedFolder {
 public:
  /// The shards named in `distrusted` (see EarlierShards) count as done only after their bytes were
  /// hashed, and with another commit record if it was that.
  SharedFolder(std::filesystem::path folder, std::string plan_hash,
               std::map<std::string, std::string> distrusted,
               std::chrono::steady_clock::duration tell_interval = std::chrono::seconds(2));

  /// Takes its claims back.
  ~SharedFolder();
  SharedFolder(const SharedFolder&) = delete;
  SharedFolder& operator=(const SharedFolder&) = delete;

  /// What others do with a shard; kFree claims it. Lists the folder so seldom that it costs little.
  /// Throws std::runtime_error naming the path if the folder cannot be listed or written to.
  ShardActivity look_at(const PlannedShard& shard);

  /// Whether the shard is committed.
  bool is_done(const PlannedShard& shard) const;

  /// So many samples of the shard are written.
  void tell(const PlannedShard& shard, int samples);

  /// The shard is committed, or given up: its claim goes.
  void release(const PlannedShard& shard);

 private:
  struct Claim {
    std::filesystem::path file;
    int descriptor = -1;  // kept: a name could lead elsewhere by now
  };

  bool is_busy(const PlannedShard& shard);
  void claim(const PlannedShard& shard);
  static void end(const Claim& claim);

  std::filesystem::path folder_;
  std::string plan_hash_;
  std::map<std::string, std::string> distrusted_;  // with the text of a commit record that is wrong
  std::mutex mutex_;
  std::map<std::string, Claim> claims_;  // by shard
  std::chrono::steady_clock::duration tell_interval_;
  std::chrono::steady_clock::time_point next_tell_;
  std::set<std::string> busy_;  // what others write, when last listed
  std::chrono::steady_clock::time_point next_listing_;
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

  /// The next shard to make; nullptr at the end, and from then on. `stop` is asked between looks,
  /// which may take long; true is the end. None: nobody asks. Throws what `look` throws.
  const PlannedShard* next(const std::function<bool()>& stop = {});

  /// Shards that others finished before their turn came.
  const std::vector<const PlannedShard*>& done_by_others() const { return done_by_others_; }

 private:
  const PlannedShard* next_deferred(const std::function<bool()>& stop);

  std::deque<const PlannedShard*> shards_;
  std::deque<const PlannedShard*> deferred_;
  std::vector<const PlannedShard*> done_by_others_;
  Look look_;
};

}  // namespace eventgan
