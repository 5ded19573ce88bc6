#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>

namespace eventgan {

/// kAuto is a bar on a terminal and lines elsewhere.
enum class ProgressStyle { kAuto, kBar, kLines, kJson, kNone };

/// What a run counts.
struct ProgressUnit {
  std::string name = "pairs";
  bool has_bytes = true;  ///< whether the bytes so far are told
};

/// Where a run stands.
struct ProgressState {
  std::int64_t done = 0;
  std::int64_t total = 0;
  std::int64_t quarantined = 0;
  std::int64_t bytes = 0;  ///< compressed volumes so far
  double seconds = 0;      ///< since the start
  ProgressUnit unit;

  double per_second() const { return seconds > 0 ? double(done) / seconds : 0; }
  double megabytes_per_second() const { return seconds > 0 ? double(bytes) / 1e6 / seconds : 0; }
  /// 0 until the first is done.
  double seconds_left() const {
    return done > 0 ? seconds / double(done) * double(total - done) : 0;
  }
};

/// One line of progress in words, without line ends.
std::string progress_line(const ProgressState& state);

/// The same with a bar of `width` columns in front.
std::string progress_bar(const ProgressState& state, int width);

/// The same as JSON: {"event": "progress", "done": ..., ...}.
std::string progress_json(const ProgressState& state);

/// What ended the run, as JSON: {"event": "error", "text": ...}.
std::string error_json(const std::string& text);

/// A warning as JSON: {"event": "warning", "text": ...}.
std::string warning_json(const std::string& text);

/// Something that is no warning, as JSON: {"event": "note", "text": ...}.
std::string note_json(const std::string& text);

/// Shows progress on a stream: a bar redrawn ten times a second, a plain line every 10 s, or a JSON
/// line a second; each also at the end. Thread safety: one thread at a time.
class Progress {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  /// kAuto asks whether the stream's terminal is there: `is_terminal`. `clock` is for tests.
  Progress(std::ostream& stream, ProgressStyle style, bool is_terminal, std::int64_t total,
           Clock clock = std::chrono::steady_clock::now, ProgressUnit unit = {});

  /// Ends the bar's line if an error has kept `finish` from it.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// One more is done.
  void advance(bool quarantined, std::int64_t bytes);

  /// There is more or less to do than was thought.
  void set_total(std::int64_t total) { state_.total = total; }

  /// Shows the last state and ends the line.
  void finish();

 private:
  void show(bool last);

  std::ostream& stream_;
  ProgressStyle style_;
  Clock clock_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point shown_;
  ProgressState state_;
  bool finished_ = false;
};

}  // namespace eventgan
