#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

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

/// Takes the cursor to the start of its row and wipes everything from there on.
inline constexpr char kWipeRow[] = "\r\x1b[J";

/// What a run has to show, in words and as JSON, both without line ends.
struct ProgressText {
  std::int64_t done = 0;
  std::int64_t total = 0;
  std::string line;  ///< parts with ", " between them, what matters most first
  std::string json;
};

/// Shows on a stream how a run goes on: a bar redrawn ten times a second, a plain line every 10 s,
/// or a JSON line a second.
///
/// The bar keeps to one row of the terminal however that is resized: the cursor rests at the row's
/// start, which is where a terminal that wraps the row again leaves it, and everything from there
/// on is wiped before the bar is drawn again. Thread safe.
class ProgressDisplay {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;
  /// Columns of the terminal, asked before each bar. None: no terminal that can redraw a line.
  using Columns = std::function<int()>;
  /// What is to be shown at a time; called by one thread at a time, also by that of keep_up().
  using Describe = std::function<ProgressText(std::chrono::steady_clock::time_point now)>;

  /// kAuto is a bar if there are `columns`. `clock` is for tests. What `describe` refers to is
  /// changed in update() alone, and must outlive the display.
  ProgressDisplay(std::ostream& stream, ProgressStyle style, Columns columns, Clock clock,
                  Describe describe);

  /// Ends the bar's line.
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  /// From now on it shows the state by itself, also while nothing changes for long, and draws
  /// the bar again when the terminal is resized.
  void keep_up();

  /// When this was made.
  std::chrono::steady_clock::time_point start() const { return start_; }

  /// Lets `change` change what is described, at the time it is given, and shows it: `at_once`, or
  /// if enough time has passed since something was shown, or since the start.
  void update(const std::function<void(std::chrono::steady_clock::time_point now)>& change,
              bool at_once = false);

  /// What keep_up() does ten times a second: shows the state if it is time for that, or if the
  /// bar has not the terminal's width any more.
  void refresh();

  /// Shows the state at the end, and ends the bar's line. `passing`: only where something was
  /// shown before, and the bar goes.
  void finish(bool passing);

 private:
  void show(std::chrono::steady_clock::time_point now);
  int columns() const;
  void end_line();

  std::mutex mutex_;
  std::ostream& stream_;
  ProgressStyle style_;
  Columns columns_;
  Clock clock_;
  Describe describe_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point shown_;
  bool anything_shown_ = false;
  int bar_columns_ = 0;  // the terminal's when the bar was drawn that is there; 0: none does
  std::condition_variable_any wake_;
  std::jthread keeper_;
};

/// The bar and the line on one row of a terminal of so many columns, the last of which stays free:
/// the line's last parts make room for the bar, the bar for its first two, where all do not fit.
std::string fitted_line(const ProgressText& text, int columns);

/// "[###.......]": `done` of `total` on `width` columns.
std::string progress_bar(std::int64_t done, std::int64_t total, int width);

/// What a run counts.
struct ProgressUnit {
  std::string name = "pairs";
  bool has_bytes = true;  ///< whether the bytes so far are told
  /// "planning", "checking": one of several in a run, told only while it takes time. Empty: what
  /// the run is there for.
  std::string phase = {};
};

/// How far a run is.
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

/// Progress of a run that counts things of one kind; see ProgressDisplay. Thread safe.
class Progress {
 public:
  using Clock = ProgressDisplay::Clock;

  Progress(std::ostream& stream, ProgressStyle style, ProgressDisplay::Columns columns,
           std::int64_t total, Clock clock = std::chrono::steady_clock::now,
           ProgressUnit unit = {});

  /// See ProgressDisplay::keep_up().
  void keep_up() { display_.keep_up(); }

  /// One more is done.
  void advance(bool quarantined, std::int64_t bytes);

  /// There is more or less to do than was thought.
  void set_total(std::int64_t total) { total_ = total; }

  /// Shows the last state and ends the line; a phase's bar goes.
  void finish();

 private:
  std::atomic<std::int64_t> total_;
  ProgressState state_;
  ProgressDisplay display_;
};

/// Shows a phase of a run beside what it is there for, such as the planning of 10^6 pairs: what it
/// counts, and how many there are. A function of this type may be empty: then nobody looks.
using ShowPhase = std::function<std::unique_ptr<Progress>(const ProgressUnit&, std::int64_t total)>;

/// A phase from its beginning to the end of the scope; shows nothing without `show` or things to
/// count. Thread safe.
class Phase {
 public:
  Phase(const ShowPhase& show, const ProgressUnit& unit, std::int64_t total)
      : progress_(show && total > 0 ? show(unit, total) : nullptr) {}
  ~Phase() {
    if (progress_) progress_->finish();
  }
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

  /// One more is done, of so many bytes.
  void advance(std::int64_t bytes = 0) {
    if (progress_) progress_->advance(/*quarantined=*/false, bytes);
  }

 private:
  std::unique_ptr<Progress> progress_;
};

}  // namespace eventgan
