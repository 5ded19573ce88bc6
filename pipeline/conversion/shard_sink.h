#pragma once

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
#include "pipeline/conversion/sample_message.h"
#include "stages/shards/shard_writer.h"

namespace eventgan {

/// True if so many of a plan's samples are quarantined that its error policy calls the run failed.
bool beyond_limits(const ErrorSpec& errors, std::int64_t quarantined, std::int64_t planned);

/// Takes finished samples in plan order, writes them into shards and commits each shard with its
/// marker. Enforces the manifest's error policy: with "fail" the first fault throws TooManyFaults;
/// with "quarantine" the shard in which the limits are passed is still committed, then `stopped()`
/// turns true and what follows is ignored. Thread safety: one thread at a time.
class ShardSink {
 public:
  /// `planned` is the whole plan's number of samples, `quarantined_before` those that shards done
  /// earlier hold; `header_of` gives the header of a planned shard.
  ShardSink(std::filesystem::path folder, std::string plan_hash, const ErrorSpec& errors,
            std::int64_t planned, std::int64_t quarantined_before,
            std::function<ShardHeader(const PlannedShard&)> header_of);

  /// The next sample. Throws std::runtime_error if the disk fails.
  void accept(SampleMessage& message);

  bool stopped() const { return stopped_; }
  std::int64_t written() const { return written_; }
  const std::vector<QuarantinedSample>& quarantined() const { return quarantined_; }
  const std::vector<ShardMarker>& markers() const { return markers_; }

 private:
  void commit(const PlannedShard& shard);

  std::filesystem::path folder_;
  std::string plan_hash_;
  ErrorSpec errors_;
  std::int64_t planned_;
  std::int64_t quarantined_before_;
  std::function<ShardHeader(const PlannedShard&)> header_of_;

  std::unique_ptr<ShardWriter> writer_;  // of the shard under way
  ShardMarker marker_;                   // of the shard under way
  std::int64_t written_ = 0;
  std::vector<QuarantinedSample> quarantined_;
  std::vector<ShardMarker> markers_;
  bool stopped_;
};

}  // namespace eventgan
