#include "pipeline/retry/retry_sink.h"

#include <cstddef>
#include <optional>

#include "pipeline/profile/trace_span.h"

namespace eventgan {

RetrySink::RetrySink(const std::filesystem::path& folder, const std::vector<RetriedShard>& shards,
                     ShardPace& pace, RetryReport& report, TraceRecorder* trace)
    : folder_(folder),
      next_(shards.begin()),
      shard_(shards.end()),
      pace_(pace),
      report_(report),
      trace_(trace) {}

void RetrySink::accept(const SampleMessage& message) {
  if (!rewrite_) open();
  const auto place = static_cast<std::size_t>(message.slot);
  const int slot = shard_->slots.at(place);
  rewrite_->redo(slot, message);
  if (message.failed()) {
    failed_.push_back({shard_->samples.name, slot, message.sample.sample_id, message.sample.fault});
  }
  pace_.take(std::ssize(message.chunk));
  if (place + 1 == shard_->slots.size()) commit();
}

void RetrySink::abandon() {
  rewrite_.reset();
  failed_.clear();
  pace_.close();
}

void RetrySink::open() {
  shard_ = next_++;
  const bool size_unknown = shard_->samples.size_unknown;
  rewrite_ = std::make_unique<ShardRewrite>(
      folder_, shard_->marker,
      size_unknown ? std::optional(shard_->samples.volume_size) : std::nullopt);
  pace_.open(static_cast<int>(shard_->slots.size()));
}

void RetrySink::commit() {
  TraceSpan span(trace_, "commit shard", "shard");
  span.note("shard", shard_->samples.name);
  pace_.begin_commit();
  report_.shards_rewritten += rewrite_->commit();
  rewrite_.reset();
  pace_.close();
  const std::int64_t mended = std::ssize(shard_->slots) - std::ssize(failed_);
  report_.tried += std::ssize(shard_->slots);
  report_.mended += mended;
  report_.quarantined -= mended;
  report_.failed.insert(report_.failed.end(), failed_.begin(), failed_.end());
  failed_.clear();
}

}  // namespace eventgan
