#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "pipeline/runtime/trace_file.h"

namespace eventgan {

/// A piece of work of one thread, in nanoseconds.
struct TracedWork {
  const char* name = "";
  const char* category = "";
  std::int64_t start_ns = 0;      ///< by TraceRecorder::now_ns
  std::int64_t duration_ns = 0;   ///< wall time
  std::int64_t cpu_start_ns = 0;  ///< processor time of the thread when the work began
  std::int64_t cpu_ns = 0;        ///< processor time that the work took
  std::string_view arguments;     ///< members of a JSON object, without the braces
};

/// What the run counts and a TraceWatch writes down now and then.
struct TraceGauges {
  std::atomic<int> samples_in_flight = 0;  ///< between the graph's source and the writer's end
  std::atomic<int> samples_at_work = 0;    ///< of these, in a stage; the others wait for one
};

/// Records what the threads of a run do, as JSON in the object format of the Trace Event Format
/// (ts and dur in microseconds of wall time since the recorder's start, tts and tdur in those of
/// the thread's processor time). Events are text at once, in a buffer of 64 KiB for each thread
/// that goes into the file when it is full: memory does not grow with the run, and no event is
/// dropped.
///
/// Whatever happens to the trace, the run goes on: an error of writing is kept for `finish`; the
/// file is deleted, so that a full disk gets its space back, and what follows is not recorded.
/// Thread safe, but for `finish` and the destructor.
class TraceRecorder {
 public:
  /// Throws UsageError as TraceFile does. `about` is for the reader: the format's otherData.
  TraceRecorder(const std::filesystem::path& file, std::map<std::string, std::string> about);

  /// Without `finish` nothing is left of the trace.
  ~TraceRecorder();
  TraceRecorder(const TraceRecorder&) = delete;
  TraceRecorder& operator=(const TraceRecorder&) = delete;

  /// Since the start.
  std::int64_t now_ns() const;

  /// Adds work that the calling thread has done. Work of one thread must nest.
  void add(const TracedWork& work) noexcept;

  /// Adds what a counter is at now: `unit` names the number.
  void add_counter(const char* name, const char* unit, double value) noexcept;

  TraceGauges& gauges() { return gauges_; }

  /// Completes the file. No other thread may record any more. Throws std::runtime_error if the
  /// trace could not be written, now or earlier. Once.
  void finish();

 private:
  struct Thread;

  Thread& this_thread();
  void append(Thread& thread, std::string_view event);
  void flush(Thread& thread);
  void write(std::string_view text);

  const std::uint64_t number_;  // no other recorder of the process has it
  const std::chrono::steady_clock::time_point start_;
  std::map<std::string, std::string> about_;
  TraceGauges gauges_;
  std::mutex threads_mutex_;
  std::vector<std::unique_ptr<Thread>> threads_;
  std::atomic<int> workers_ = 0;
  std::mutex file_mutex_;
  std::unique_ptr<TraceFile> file_;  // null after an error, and at the end
  std::string error_;                // why
};

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
