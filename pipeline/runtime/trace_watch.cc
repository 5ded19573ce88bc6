#include "pipeline/runtime/trace_watch.h"

#include <unistd.h>

#include <condition_variable>
#include <fstream>
#include <mutex>

#include "pipeline/runtime/threads.h"

namespace eventgan {
namespace {

/// Over less than this a rate is noise.
constexpr std::int64_t kShortestRate_ns = 1'000'000;

double resident_megabytes() {
  std::int64_t whole_pages = 0, resident_pages = 0;
  std::ifstream("/proc/self/statm") >> whole_pages >> resident_pages;
  return 1e-6 * static_cast<double>(resident_pages * ::sysconf(_SC_PAGESIZE));
}

}  // namespace

TraceWatch::TraceWatch(TraceRecorder& trace, std::chrono::milliseconds period)
    : trace_(trace),
      looked_ns_(trace.now_ns()),
      cpu_ns_(process_processor_ns()),
      thread_([this, period](const std::stop_token& stop) { watch(stop, period); }) {}

void TraceWatch::watch(const std::stop_token& stop, std::chrono::milliseconds period) {
  std::mutex mutex;
  std::condition_variable_any sleeping;
  std::unique_lock lock(mutex);
  do {
    look();
    sleeping.wait_for(lock, stop, period, [] { return false; });
  } while (!stop.stop_requested());
  look();
}

void TraceWatch::look() {
  const std::int64_t now_ns = trace_.now_ns();
  const std::int64_t cpu_ns = process_processor_ns();
  if (now_ns - looked_ns_ >= kShortestRate_ns) {
    trace_.add_counter(
        "processor", "cores at work",
        static_cast<double>(cpu_ns - cpu_ns_) / static_cast<double>(now_ns - looked_ns_));
    looked_ns_ = now_ns;
    cpu_ns_ = cpu_ns;
  }
  trace_.add_counter("resident memory", "MB", resident_megabytes());
  const TraceGauges& gauges = trace_.gauges();
  trace_.add_counter("samples in flight", "samples", gauges.samples_in_flight);
  trace_.add_counter("samples at work", "samples", gauges.samples_at_work);
}

}  // namespace eventgan
