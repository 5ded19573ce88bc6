#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "pipeline/profile/trace_recorder.h"

namespace eventgan {

/// Records its own scope as work of the calling thread; also one that an exception ends. Without a
/// recorder it does nothing and allocates nothing. Thread safety: one thread, that which began it.
class TraceSpan {
 public:
  /// `trace` may be null. Both texts must outlive the span.
  TraceSpan(TraceRecorder* trace, const char* name, const char* category);
  ~TraceSpan();
  TraceSpan(const TraceSpan&) = delete;
  TraceSpan& operator=(const TraceSpan&) = delete;

  /// Says something of the work to the viewer; each key once.
  void note(const char* key, std::string_view text) noexcept;
  void note(const char* key, std::int64_t number) noexcept;

 private:
  void add_argument(const char* key, const std::string& value);

  TraceRecorder* trace_;
  TracedWork work_;
  std::string arguments_;
};

}  // namespace eventgan
