#pragma once

#include "pipeline/profile/trace_span.h"
#include "pipeline/samples/sample_message.h"

namespace eventgan {

/// Records its own scope as one stage's work on one sample, and counts it among the samples at
/// work. Noted are the sample, its shard and slot, the pixels and, once it is encoded, the
/// bytes of its volume, the time since the stage before (`waited_us`: in a queue, or for the turn
/// at the writer), and the fault if the sample failed here. Does nothing without a recorder.
class SampleSpan {
 public:
  /// `trace` may be null; the message must outlive the span.
  SampleSpan(TraceRecorder* trace, Stage stage, SampleMessage& message);
  ~SampleSpan();
  SampleSpan(const SampleSpan&) = delete;
  SampleSpan& operator=(const SampleSpan&) = delete;

 private:
  TraceRecorder* trace_;
  SampleMessage& message_;
  bool failed_before_;
  TraceSpan span_;
};

}  // namespace eventgan
