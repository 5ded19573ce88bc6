#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/files/atomic_file.h"

namespace eventgan {

/// Pieces of trace files. All thread safe.

/// The text as a JSON string with its quotes; bytes that are not UTF-8 become U+FFFD.
std::string trace_string(std::string_view text);

/// Nanoseconds ≥ 0 as microseconds, which the format counts in, without loss: 1234567 → "1234.567".
/// Rounded ones could make the end of a span overlap the end of the one around it.
std::string trace_microseconds(std::int64_t nanoseconds);

/// How every trace of this program begins.
inline constexpr std::string_view kTraceBegins = "{\"traceEvents\":[";

/// A trace that grows under a temporary name beside `target`, so that it need not be in memory,
/// and is there whole or not at all. Thread safety: one thread at a time.
class TraceFile {
 public:
  /// Throws UsageError if `target` cannot be written to, or holds what is neither empty nor a
  /// trace: a trace given the wrong name by a slip of the hand is not worth a manifest. If it is a
  /// link, what it points to is written. Deletes what dead writers of the same trace have left.
  explicit TraceFile(const std::filesystem::path& target);

  /// Throws std::runtime_error naming the path.
  void write(std::string_view text);

  /// Flushes to disk and renames, over an earlier trace too. Throws as `write` does. Once.
  void commit() { file_.publish(); }

 private:
  AtomicFile file_;
};

}  // namespace eventgan
