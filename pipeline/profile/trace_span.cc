#include "pipeline/profile/trace_span.h"

#include <exception>

#include "pipeline/profile/processor_time.h"
#include "pipeline/profile/trace_text.h"

namespace eventgan {

TraceSpan::TraceSpan(TraceRecorder* trace, const char* name, const char* category) : trace_(trace) {
  if (!trace_) return;
  work_.name = name;
  work_.category = category;
  work_.start_ns = trace_->now_ns();
  work_.cpu_start_ns = thread_processor_ns();
}

TraceSpan::~TraceSpan() {
  if (!trace_) return;
  work_.cpu_ns = thread_processor_ns() - work_.cpu_start_ns;
  work_.duration_ns = trace_->now_ns() - work_.start_ns;
  work_.arguments = arguments_;
  trace_->add(work_);
}

void TraceSpan::note(const char* key, std::string_view text) noexcept try {
  if (trace_) add_argument(key, trace_string(text));
} catch (const std::exception&) {
  // Out of memory, as in TraceRecorder::add.
}

void TraceSpan::note(const char* key, std::int64_t number) noexcept try {
  if (trace_) add_argument(key, std::to_string(number));
} catch (const std::exception&) {
  // As above.
}

/// All of it or nothing: half an argument would break the file.
void TraceSpan::add_argument(const char* key, const std::string& value) {
  arguments_ += (arguments_.empty() ? "" : ",") + trace_string(key) + ":" + value;
}

}  // namespace eventgan
