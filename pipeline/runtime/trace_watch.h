#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>
#include <thread>

#include "pipeline/runtime/trace.h"

namespace eventgan {

/// Writes counters into a trace while it lives, from a thread of its own, at once, now and then and
/// at its end: resident memory (MB), processor cores at work since the last look, and the
/// recorder's gauges.
class TraceWatch {
 public:
  /// `trace` must outlive it.
  explicit TraceWatch(TraceRecorder& trace,
                      std::chrono::milliseconds period = std::chrono::milliseconds(250));

 private:
  void watch(const std::stop_token& stop, std::chrono::milliseconds period);
  void look();

  TraceRecorder& trace_;
  std::int64_t looked_ns_;  // when the processor was last looked at
  std::int64_t cpu_ns_;     // of the process, then
  std::jthread thread_;     // last, so that it ends first
};

}  // namespace eventgan
