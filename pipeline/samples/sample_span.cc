#include "pipeline/samples/sample_span.h"

namespace eventgan {

SampleSpan::SampleSpan(TraceRecorder* trace, Stage stage, SampleMessage& message)
    : trace_(trace),
      message_(message),
      failed_before_(message.failed()),
      span_(trace, kStageNames[static_cast<std::size_t>(stage)], "sample") {
  if (!trace_) return;
  ++trace_->gauges().samples_at_work;
  span_.note("sample", message.planned().sample_id);
  span_.note("shard", message.shard->name);
  span_.note("slot", message.slot);
  span_.note("pixels", static_cast<std::int64_t>(message.shard->volume_size.pixel_count()));
  if (message.traced_ns > 0) span_.note("waited_us", (trace_->now_ns() - message.traced_ns) / 1000);
}

SampleSpan::~SampleSpan() {
  if (!trace_) return;
  if (!message_.chunk.empty()) span_.note("bytes", std::ssize(message_.chunk));
  if (message_.failed() && !failed_before_) span_.note("fault", message_.sample.fault);
  message_.traced_ns = trace_->now_ns();
  --trace_->gauges().samples_at_work;
}

}  // namespace eventgan
