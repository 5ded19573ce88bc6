#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "pipeline/profile/trace_recorder.h"
#include "pipeline/retry/retry_report.h"
#include "pipeline/retry/retry_work.h"
#include "pipeline/retry/shard_rewrite.h"
#include "pipeline/samples/sample_message.h"
#include "pipeline/stopping/shard_pace.h"

namespace eventgan {

/// Takes redone samples in the order of the shards, puts them into these and commits one shard
/// after the other. Thread safety: one thread at a time.
class RetrySink {
 public:
  /// `pace` is told how it gets on; `report` gets tried, mended, failed, shards_rewritten and what
  /// is quarantined still, for each shard once it is through. `trace` gets the commits; null:
  /// nobody asks. All must outlive the sink.
  RetrySink(const std::filesystem::path& folder, const std::vector<RetriedShard>& shards,
            ShardPace& pace, RetryReport& report, TraceRecorder* trace = nullptr);

  /// The next sample; its slot is its place among the shard's retried samples. Throws
  /// std::runtime_error if the disk fails.
  void accept(const SampleMessage& message);

  /// Whether samples of the shard under way are still to come.
  bool is_open() const { return rewrite_ != nullptr; }

  /// Deletes the file under way, if any; its samples do not count as tried.
  void abandon();

 private:
  void open();
  void commit();

  const std::filesystem::path& folder_;
  std::vector<RetriedShard>::const_iterator next_;
  std::vector<RetriedShard>::const_iterator shard_;  // under way
  std::unique_ptr<ShardRewrite> rewrite_;            // of the shard under way
  std::vector<QuarantinedSlot> failed_;              // of the shard under way
  ShardPace& pace_;
  RetryReport& report_;
  TraceRecorder* trace_;
};

}  // namespace eventgan
