#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <string_view>

namespace eventgan {

/// kAuto is a bar on a terminal and lines elsewhere.
enum class ProgressStyle { kAuto, kBar, kLines, kJson, kNone };

/// A duration, rounded to seconds, in `count` units of d, h, m and s, such as "3h00m". The first is
/// the largest of the units in `leading` that the duration reaches, else the last of these: with
/// "hm" 45 seconds are "0m45s".
std::string duration_text(double seconds, std::string_view leading, int count = 2);

/// A message as one line of JSON: {"event": EVENT, "text": TEXT}. The event of what ended the run
/// is "error", of a warning "warning", of anything else "note".
std::string message_json(std::string_view event, std::string_view text);

/// Shows on a stream how a run goes on: a bar redrawn ten times a second, a plain line every 10 s,
/// or a JSON line a second. Thread safety: one thread at a time.
class ProgressDisplay {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  /// kAuto asks whether the stream's terminal is there: `is_terminal`. `clock` is for tests.
  ProgressDisplay(std::ostream& stream, ProgressStyle style, bool is_terminal, int bar_width,
                  Clock clock);

  /// Ends the bar's line.
  ~ProgressDisplay() { end_line(); }
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  /// When this was made.
  std::chrono::steady_clock::time_point start() const { return start_; }
  std::chrono::steady_clock::time_point now() const { return clock_(); }

  /// Whether enough time has passed since something was shown, or since the start.
  bool is_due() const;

  /// `line` and `json` tell the same of the time `now`, without line ends: `done` of `total`, and
  /// more.
  void show(std::chrono::steady_clock::time_point now, std::int64_t done, std::int64_t total,
            const std::string& line, const std::string& json);

  /// Ends the bar's line, if there is one: something else is written next.
  void end_line();

 private:
  std::ostream& stream_;
  ProgressStyle style_;
  int bar_width_;
  Clock clock_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point shown_;
  std::size_t widest_ = 0;  // of the bar's line; 0: there is none
};

/// "[###.......]": `done` of `total` on `width` columns.
std::string progress_bar(std::int64_t done, std::int64_t total, int width);

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

/// The same as JSON: {"event": "progress", "done": ..., ...}.
std::string progress_json(const ProgressState& state);

/// Progress of a run that counts things of one kind; see ProgressDisplay.
class Progress {
 public:
  using Clock = ProgressDisplay::Clock;

  Progress(std::ostream& stream, ProgressStyle style, bool is_terminal, std::int64_t total,
           Clock clock = std::chrono::steady_clock::now, ProgressUnit unit = {});

  /// One more is done.
  void advance(bool quarantined, std::int64_t bytes);

  /// There is more or less to do than was thought.
  void set_total(std::int64_t total) { state_.total = total; }

  /// Shows the last state and ends the line.
  void finish();

 private:
  void show();

  ProgressDisplay display_;
  ProgressState state_;
};

}  // namespace eventgan
