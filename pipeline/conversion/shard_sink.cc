#include "pipeline/conversion/shard_sink.h"

#include <utility>

#include "manifests/error_limits.h"
#include "manifests/faults.h"
#include "pipeline/profile/processor_time.h"
#include "pipeline/profile/trace_span.h"
#include "stages/files/atomic_file.h"

namespace eventgan {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double busy_seconds_since(std::int64_t start_ns) {
  return 1e-9 * static_cast<double>(thread_processor_ns() - start_ns);
}

double& write_seconds(ShardMarker& marker) {
  return marker.stage_seconds[kStageNames[static_cast<std::size_t>(Stage::kWrite)]];
}

}  // namespace

ShardSink::ShardSink(SinkSetup setup, ShardPace& pace)
    : setup_(std::move(setup)),
      pace_(pace),
      committed_at_(std::chrono::steady_clock::now()),
      quarantined_(setup_.quarantined_before),
      closed_(beyond_limits(setup_.errors, quarantined_, setup_.planned)) {}

bool ShardSink::accept(SampleMessage& message) {
  if (!obey()) return false;
  const std::int64_t start_ns = thread_processor_ns();
  const PlannedShard& shard = *message.shard;
  if (message.failed() && setup_.errors.policy == ErrorPolicy::kFail) {
    throw TooManyFaults("errors.policy is \"fail\": " + message.sample.fault);
  }
  if (!writer_) open(shard);
  writer_->append(message.sample, message.chunk);
  ++marker_.samples;
  if (message.failed()) {
    marker_.quarantined.push_back({message.slot, message.sample.sample_id, message.sample.fault});
  } else {
    ++marker_.valid;
  }
  for (std::size_t stage = 0; stage < kStageCount; ++stage) {
    marker_.stage_seconds[kStageNames[stage]] += message.seconds[stage];
  }
  write_seconds(marker_) += busy_seconds_since(start_ns);
  pace_.take(std::ssize(message.chunk));
  if (marker_.samples == static_cast<int>(shard.samples.size())) commit(shard);
  return true;
}

void ShardSink::abandon() {
  writer_.reset();
  pace_.close();
}

bool ShardSink::obey() {
  if (closed_) return false;
  const StopOrder order = setup_.order();
  if (order == StopOrder::kAbort || (order == StopOrder::kFinishShard && !writer_)) {
    abandon();
    closed_ = true;
  }
  return !closed_;
}

void ShardSink::open(const PlannedShard& shard) {
  TraceSpan span(setup_.trace, "open shard", "shard");
  span.note("shard", shard.name);
  writer_ = std::make_unique<ShardWriter>(setup_.folder, setup_.header_of(shard));
  if (setup_.opened) setup_.opened(shard);
  marker_ = {};
  marker_.shard = shard.name;
  marker_.plan_hash = setup_.plan_hash;
  pace_.open(static_cast<int>(shard.samples.size()));
}

void ShardSink::commit(const PlannedShard& shard) {
  TraceSpan span(setup_.trace, "commit shard", "shard");
  span.note("shard", shard.name);
  span.note("samples", marker_.samples);
  const std::int64_t start_ns = thread_processor_ns();
  pace_.begin_commit();
  ShardReceipt receipt;
  try {
    const TraceSpan file(setup_.trace, "close, fsync, hash, rename", "shard");
    receipt = writer_->commit();
  } catch (const UnfinishedShardLost&) {
    if (!setup_.is_done || !setup_.is_done(shard)) throw;
    abandon();
    done_by_others_.push_back(&shard);
    return;
  }
  writer_.reset();
  marker_.sha256 = receipt.sha256;
  marker_.size_bytes = receipt.size_bytes;
  span.note("bytes", receipt.size_bytes);
  enter(std::move(receipt.contents), marker_);
  write_seconds(marker_) += busy_seconds_since(start_ns);
  marker_.wall_seconds = seconds_since(committed_at_);
  {
    const TraceSpan file(setup_.trace, "write marker", "shard");
    write_file_atomically(setup_.folder / marker_name(shard.name), to_json(marker_));
  }
  pace_.close();
  committed_at_ = std::chrono::steady_clock::now();
  quarantined_ += std::ssize(marker_.quarantined);
  committed_.push_back({&shard, std::move(marker_)});
  closed_ = beyond_limits(setup_.errors, quarantined_, setup_.planned);
}

}  // namespace eventgan
