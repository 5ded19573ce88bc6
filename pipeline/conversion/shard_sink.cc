#include "pipeline/conversion/shard_sink.h"

#include <chrono>

#include "manifests/faults.h"
#include "stages/files/atomic_file.h"

namespace eventgan {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

bool beyond_limits(const ErrorSpec& errors, std::int64_t quarantined, std::int64_t planned) {
  if (errors.policy == ErrorPolicy::kFail) return quarantined > 0;
  return quarantined > errors.max_count ||
         static_cast<double>(quarantined) > errors.max_fraction * static_cast<double>(planned);
}

ShardSink::ShardSink(std::filesystem::path folder, std::string plan_hash, const ErrorSpec& errors,
                     std::int64_t planned, std::int64_t quarantined_before,
                     std::function<ShardHeader(const PlannedShard&)> header_of)
    : folder_(std::move(folder)),
      plan_hash_(std::move(plan_hash)),
      errors_(errors),
      planned_(planned),
      quarantined_before_(quarantined_before),
      header_of_(std::move(header_of)),
      stopped_(beyond_limits(errors, quarantined_before, planned)) {}

void ShardSink::accept(SampleMessage& message) {
  if (stopped_) return;
  const auto start = std::chrono::steady_clock::now();
  const PlannedShard& shard = *message.shard;
  if (message.failed() && errors_.policy == ErrorPolicy::kFail) {
    throw TooManyFaults("errors.policy is \"fail\": " + message.sample.fault);
  }
  if (!writer_) {
    writer_ = std::make_unique<ShardWriter>(folder_, header_of_(shard));
    marker_ = {shard.name, plan_hash_, "", 0, 0, 0, {}, {}};
  }
  writer_->append(message.sample, message.chunk);
  ++marker_.samples;
  if (message.failed()) {
    marker_.quarantined.push_back({message.slot, message.sample.sample_id, message.sample.fault});
    quarantined_.push_back(marker_.quarantined.back());
  } else {
    ++marker_.valid;
    ++written_;
  }
  for (std::size_t stage = 0; stage < kStageCount; ++stage) {
    marker_.stage_seconds[kStageNames[stage]] += message.seconds[stage];
  }
  const bool last = marker_.samples == static_cast<int>(shard.samples.size());
  marker_.stage_seconds[kStageNames[static_cast<std::size_t>(Stage::kWrite)]] +=
      seconds_since(start);
  if (last) commit(shard);
}

void ShardSink::commit(const PlannedShard& shard) {
  const auto start = std::chrono::steady_clock::now();
  const ShardReceipt receipt = writer_->commit();
  writer_.reset();
  marker_.sha256 = receipt.sha256;
  marker_.size_bytes = receipt.size_bytes;
  marker_.stage_seconds[kStageNames[static_cast<std::size_t>(Stage::kWrite)]] +=
      seconds_since(start);
  write_file_atomically(folder_ / marker_name(shard.name), to_json(marker_));
  markers_.push_back(marker_);
  stopped_ = beyond_limits(errors_, quarantined_before_ + std::ssize(quarantined_), planned_);
}

}  // namespace eventgan
