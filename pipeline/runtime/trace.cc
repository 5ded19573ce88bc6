#include "pipeline/runtime/trace.h"

#include <unistd.h>

#include <condition_variable>
#include <ctime>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "manifests/documents/json_text.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/runtime/trace_file.h"

namespace eventgan {
namespace {

constexpr std::size_t kBufferBytes = 64 << 10;

std::uint64_t next_number() {
  static std::atomic<std::uint64_t> next{1};
  return next++;
}

std::string now_utc() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

/// An event that tells of the process or, with its number, of a thread.
std::string metadata(const char* what, int thread, const std::string& arguments) {
  return R"({"ph":"M","name":")" + std::string(what) + R"(","pid":)" + std::to_string(::getpid()) +
         R"(,"tid":)" + std::to_string(thread) + R"(,"args":{)" + arguments + "}}";
}

std::string quoted_member(const char* key, std::string_view text) {
  return "\"" + std::string(key) + "\":" + trace_string(text);
}

}  // namespace

struct TraceRecorder::Thread {
  int id = 0;
  bool named = false;
  std::mutex mutex;
  std::string buffer;
};

TraceRecorder::TraceRecorder(const std::filesystem::path& file,
                             std::map<std::string, std::string> about)
    : number_(next_number()),
      start_(std::chrono::steady_clock::now()),
      about_(std::move(about)),
      file_(std::make_unique<TraceFile>(file)) {
  about_["started_at"] = now_utc();
  write(std::string(kTraceBegins) + "\n" +
        metadata("process_name", ::getpid(), quoted_member("name", "eventgan")));
}

TraceRecorder::~TraceRecorder() = default;

std::int64_t TraceRecorder::now_ns() const {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now() - start_).count();
}

void TraceRecorder::add(const TracedWork& work) noexcept try {
  Thread& thread = this_thread();
  const std::lock_guard lock(thread.mutex);
  if (!std::exchange(thread.named, true)) {
    const bool is_main = thread.id == ::getpid();
    const int place = is_main ? 0 : ++workers_;
    const std::string name = is_main ? "main" : "worker " + std::to_string(place);
    append(thread, metadata("thread_name", thread.id, quoted_member("name", name)));
    append(thread,
           metadata("thread_sort_index", thread.id, "\"sort_index\":" + std::to_string(place)));
  }
  std::string event =
      R"({"ph":"X","name":)" + trace_string(work.name) + R"(,"cat":)" +
      trace_string(work.category) + R"(,"ts":)" + trace_microseconds(work.start_ns) + R"(,"dur":)" +
      trace_microseconds(work.duration_ns) + R"(,"tts":)" + trace_microseconds(work.cpu_start_ns) +
      R"(,"tdur":)" + trace_microseconds(work.cpu_ns) + R"(,"pid":)" + std::to_string(::getpid()) +
      R"(,"tid":)" + std::to_string(thread.id) + R"(,"args":{)";
  event += work.arguments;
  append(thread, event + "}}");
} catch (const std::exception&) {
  // Out of memory: the run will notice where it matters.
}

void TraceRecorder::add_counter(const char* name, const char* unit, double value) noexcept try {
  Thread& thread = this_thread();
  const std::lock_guard lock(thread.mutex);
  append(thread, R"({"ph":"C","name":)" + trace_string(name) + R"(,"ts":)" +
                     trace_microseconds(now_ns()) + R"(,"pid":)" + std::to_string(::getpid()) +
                     R"(,"args":{)" + trace_string(unit) + ":" + nlohmann::json(value).dump() +
                     "}}");
} catch (const std::exception&) {
  // As above.
}

void TraceRecorder::finish() {
  for (const auto& thread : threads_) {
    const std::lock_guard lock(thread->mutex);
    flush(*thread);
  }
  write("\n],\"displayTimeUnit\":\"ms\",\"otherData\":" + dump_json(nlohmann::json(about_)) +
        "}\n");
  const std::lock_guard lock(file_mutex_);
  const std::unique_ptr<TraceFile> file = std::move(file_);
  if (!file) throw std::runtime_error(error_);
  file->commit();
}

TraceRecorder::Thread& TraceRecorder::this_thread() {
  thread_local std::uint64_t recorder = 0;
  thread_local Thread* thread = nullptr;
  if (recorder != number_) {
    auto created = std::make_unique<Thread>();
    created->id = ::gettid();
    created->buffer.reserve(kBufferBytes);
    const std::lock_guard lock(threads_mutex_);
    thread = threads_.emplace_back(std::move(created)).get();
    recorder = number_;
  }
  return *thread;
}

/// With the thread's mutex held.
void TraceRecorder::append(Thread& thread, std::string_view event) {
  if (thread.buffer.size() + event.size() + 2 > kBufferBytes) flush(thread);
  thread.buffer += ",\n";
  thread.buffer += event;
}

/// With the thread's mutex held.
void TraceRecorder::flush(Thread& thread) {
  write(thread.buffer);
  thread.buffer.clear();
}

void TraceRecorder::write(std::string_view text) {
  const std::lock_guard lock(file_mutex_);
  if (!file_) return;
  try {
    file_->write(text);
  } catch (const std::runtime_error& error) {
    file_.reset();
    error_ = error.what();
  }
}

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
