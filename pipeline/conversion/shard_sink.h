#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/shard.h"
#include "pipeline/conversion/conversion_run.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/conversion/shard_queue.h"
#include "stages/shards/shard_writer.h"

namespace eventgan {

/// Writes the shards of `convert` and commits each with its commit record. Enforces the manifest's
/// error policy: with "fail" the first fault throws TooManyFaults; with "quarantine" the shard in
/// which the limits are passed is still committed, then the sink is closed.
class ShardSink final : public SampleSink {
 public:
  /// Both must outlive the sink. `quarantined_before`: samples in all shards of the plan that are
  /// done already.
  ShardSink(const ConversionJob& job, SharedFolder& shared, std::int64_t quarantined_before);

  void open(const PlannedShard& shard) override;
  void add(const SampleMessage& message) override;
  /// False if the file under way was lost, but another worker has committed the shard. The commit
  /// record is in place on return.
  bool commit() override;
  void abandon() override;
  bool closed() const override;

  const std::vector<CommittedShard>& committed() const { return committed_; }

 private:
  const ConversionJob& job_;
  SharedFolder& shared_;
  std::int64_t quarantined_;
  std::chrono::steady_clock::time_point committed_at_;
  std::vector<CommittedShard> committed_;
  const PlannedShard* shard_ = nullptr;  // under way, or the last one
  std::unique_ptr<ShardWriter> writer_;  // of the shard under way
  CommitRecord record_;                  // of the shard under way
};

}  // namespace eventgan
