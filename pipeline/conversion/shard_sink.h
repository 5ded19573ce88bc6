#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/outlines.h"
#include "manifests/values/shard.h"
#include "pipeline/conversion/conversion_run.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/conversion/shard_queue.h"
#include "stages/shards/shard_writer.h"

namespace eventgan {

/// Counts what labels lost (Annotation::left_out, of_other_classes, outlines_mended,
/// tracks_left_out), for people.
class LabelLosses {
 public:
  void add(const Annotation& annotation);
  /// One on boxes, one on outlines and one on tracks that tells how many, and of the first of them
  /// why, and one on boxes of other classes; none of none.
  std::vector<std::string> notes() const;

 private:
  struct Reasons {
    std::int64_t count = 0;
    std::vector<std::string> listed;
  };
  Reasons boxes_, outlines_, tracks_;
  std::size_t of_other_classes_ = 0;
};

/// For people.
std::string note_of(const OutlineCounts& outlines);

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
  /// What a person should know of all samples that were added: what labels lost, and how many pairs
  /// are the same image twice.
  std::vector<std::string> notes() const;

 private:
  const ConversionJob& job_;
  SharedFolder& shared_;
  std::int64_t quarantined_;
  std::chrono::steady_clock::time_point committed_at_;
  std::vector<CommittedShard> committed_;
  const PlannedShard* shard_ = nullptr;  // under way, or the last one
  std::unique_ptr<ShardWriter> writer_;  // of the shard under way
  CommitRecord record_;                  // of the shard under way
  LabelLosses losses_;
  std::int64_t same_images_ = 0;
};

}  // namespace eventgan
