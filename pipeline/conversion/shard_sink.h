#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/marker.h"
#include "manifests/plan.h"
#include "manifests/shard.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/profile/trace_recorder.h"
#include "pipeline/samples/sample_message.h"
#include "pipeline/stopping/stop_order.h"
#include "stages/shards/shard_writer.h"

namespace eventgan {

/// Where a sink writes, and whom it asks.
struct SinkSetup {
  std::filesystem::path folder;
  std::string plan_hash;
  ErrorSpec errors;
  std::int64_t planned = 0;             ///< the whole plan's number of samples
  std::int64_t quarantined_before = 0;  ///< in all shards of the plan that are done already
  std::function<ShardHeader(const PlannedShard&)> header_of;
  std::function<StopOrder()> order;                   ///< asked for every sample
  std::function<void(const PlannedShard&)> opened{};  ///< told of each shard whose file is there
  /// Whether another worker has committed the shard; asked if the file under way was lost.
  std::function<bool(const PlannedShard&)> is_done{};
  TraceRecorder* trace = nullptr;  ///< of opening and committing shards; null: nobody asks
};

/// Takes finished samples in plan order, writes them into shards and commits each shard with its
/// marker. Enforces the manifest's error policy: with "fail" the first fault throws TooManyFaults;
/// with "quarantine" the shard in which the limits are passed is still committed, then the sink is
/// closed. It obeys the order: kFinishShard closes it when no shard is open, kAbort at once, and
/// the file under way is deleted. A closed sink drops every sample. Thread safety: one thread at a
/// time.
class ShardSink {
 public:
  /// `pace` is told how it gets on; must outlive the sink.
  ShardSink(SinkSetup setup, ShardPace& pace);

  /// The next sample; false if it was dropped. Throws std::runtime_error if the disk fails.
  bool accept(SampleMessage& message);

  /// Deletes the file under way, if any.
  void abandon();

  bool closed() const { return closed_; }
  const std::vector<CommittedShard>& committed() const { return committed_; }
  /// Shards whose file under way was lost, but which another worker has committed.
  const std::vector<const PlannedShard*>& done_by_others() const { return done_by_others_; }

 private:
  bool obey();
  void open(const PlannedShard& shard);
  void commit(const PlannedShard& shard);

  SinkSetup setup_;
  ShardPace& pace_;
  std::unique_ptr<ShardWriter> writer_;  // of the shard under way
  ShardMarker marker_;                   // of the shard under way
  std::chrono::steady_clock::time_point committed_at_;
  std::int64_t quarantined_;
  std::vector<CommittedShard> committed_;
  std::vector<const PlannedShard*> done_by_others_;
  bool closed_;
};

}  // namespace eventgan
