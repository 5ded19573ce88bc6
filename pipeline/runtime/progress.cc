#include "pipeline/runtime/progress.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "manifests/documents/json_text.h"

namespace eventgan {
namespace {

constexpr int kWidestBar = 30;
constexpr int kNarrowestBar = 10;
constexpr std::chrono::milliseconds kRefresh(100);

ProgressStyle resolved(ProgressStyle style, bool can_redraw) {
  if (style != ProgressStyle::kAuto) return style;
  return can_redraw ? ProgressStyle::kBar : ProgressStyle::kLines;
}

std::chrono::milliseconds interval(ProgressStyle style) {
  switch (style) {
    case ProgressStyle::kBar:
      return kRefresh;
    case ProgressStyle::kJson:
      return std::chrono::seconds(1);
    default:
      return std::chrono::seconds(10);
  }
}

/// Wipes the bar that was drawn on so many columns, with the rows below that the terminal may have
/// wrapped it to if it has fewer columns now. (A wipe to the end of the
/// screen would do, were it not that tmux keeps what it wipes when that is the whole screen.)
std::string wipe_bar(int columns_before, int columns) {
  std::string wipe = "\r";
  if (columns > 0 && columns < columns_before) {
    wipe += "\0337";  // keeps the place: at the screen's end the cursor goes down no farther
    for (int row = (columns_before - 2) / columns; row > 0; --row) wipe += "\x1b[B\x1b[K";
    wipe += "\0338";
  }
  return wipe + "\x1b[K";
}

}  // namespace

std::string duration_text(double seconds, std::string_view leading, int count) {
  constexpr std::pair<char, long long> kUnits[] = {{'d', 86400}, {'h', 3600}, {'m', 60}, {'s', 1}};
  auto rest = static_cast<long long>(seconds + 0.5);
  std::string text;
  for (const auto& [unit, length] : kUnits) {
    const bool leads =
        leading.find(unit) != leading.npos && (rest >= length || unit == leading.back());
    if (text.empty() ? !leads : count == 0) continue;
    text += fmt::format("{:0{}}{}", rest / length, text.empty() ? 1 : 2, unit);
    rest %= length;
    --count;
  }
  return text;
}

std::string message_json(std::string_view event, std::string_view text) {
  return dump_json(nlohmann::json{{"event", event}, {"text", text}});
}

ProgressDisplay::ProgressDisplay(std::ostream& stream, ProgressStyle style, Columns columns,
                                 Clock clock, Describe describe)
    : stream_(stream),
      style_(resolved(style, columns != nullptr)),
      columns_(std::move(columns)),
      clock_(std::move(clock)),
      describe_(std::move(describe)),
      start_(clock_()),
      shown_(start_) {}

ProgressDisplay::~ProgressDisplay() {
  keeper_ = {};
  const std::lock_guard lock(mutex_);
  end_line();
}

void ProgressDisplay::keep_up() {
  if (style_ == ProgressStyle::kNone) return;
  keeper_ = std::jthread([this](const std::stop_token& end) {
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, end, kRefresh, [&] { return end.stop_requested(); })) {
      lock.unlock();
      refresh();
      lock.lock();
    }
  });
}

void ProgressDisplay::update(
    const std::function<void(std::chrono::steady_clock::time_point now)>& change, bool at_once) {
  const std::lock_guard lock(mutex_);
  const auto now = clock_();
  change(now);
  if (at_once || now - shown_ >= interval(style_)) show(now);
}

void ProgressDisplay::refresh() {
  const std::lock_guard lock(mutex_);
  const auto now = clock_();
  const bool is_resized = bar_columns_ > 0 && bar_columns_ != columns();
  if (is_resized || now - shown_ >= interval(style_)) show(now);
}

void ProgressDisplay::finish(bool passing) {
  keeper_ = {};
  const std::lock_guard lock(mutex_);
  if (passing && !anything_shown_) return;
  if (passing && style_ == ProgressStyle::kBar) {
    stream_ << kWipeRow << std::flush;
    bar_columns_ = 0;
    return;
  }
  show(clock_());
  end_line();
}

void ProgressDisplay::show(std::chrono::steady_clock::time_point now) {
  shown_ = now;
  if (style_ == ProgressStyle::kNone) return;
  anything_shown_ = true;
  const ProgressText text = describe_(now);
  if (style_ == ProgressStyle::kBar) {
    const int before = std::exchange(bar_columns_, columns());
    // Not wrapped: it may be narrower by now, and a terminal tells of that late.
    stream_ << wipe_bar(before, bar_columns_) + "\x1b[?7l" + fitted_line(text, bar_columns_) +
                   "\x1b[?7h\r"
            << std::flush;
  } else {
    stream_ << (style_ == ProgressStyle::kJson ? text.json : text.line) << std::endl;
  }
}

int ProgressDisplay::columns() const {
  constexpr int kOfAnyTerminal = 80;  // where the bar was asked for, and there is none
  return columns_ ? columns_() : kOfAnyTerminal;
}

void ProgressDisplay::end_line() {
  if (std::exchange(bar_columns_, 0) > 0) stream_ << std::endl;
}

std::string fitted_line(const ProgressText& text, int columns) {
  constexpr int kFrame = 3;  // the bar's brackets and the blank after it
  const int room = std::max(columns - 1, 0);
  std::string line = text.line;
  const auto length = [&] { return static_cast<int>(line.size()); };
  while (length() > room - kNarrowestBar - kFrame && line.find(", ") != line.rfind(", ")) {
    line.resize(line.rfind(", "));
  }
  while (length() > room) {
    const std::size_t last_part = line.rfind(", ");
    line.resize(last_part == line.npos ? static_cast<std::size_t>(room) : last_part);
  }
  const int width = std::min(kWidestBar, room - length() - kFrame);
  return width < kNarrowestBar ? line : progress_bar(text.done, text.total, width) + " " + line;
}

std::string progress_bar(std::int64_t done, std::int64_t total, int width) {
  const auto filled = static_cast<std::size_t>(total > 0 ? width * done / total : 0);
  return fmt::format("[{:.<{}}]", std::string(filled, '#'), width);
}

std::string progress_line(const ProgressState& state) {
  std::string line = state.unit.phase.empty() ? "" : state.unit.phase + " ";
  line += fmt::format("{}/{} {}, {} left", state.done, state.total, state.unit.name,
                      state.done > 0 ? duration_text(state.seconds_left(), "hm") : "?");
  if (state.quarantined > 0) line += fmt::format(", {} quarantined", state.quarantined);
  line += fmt::format(", {:.2f} {}/s", state.per_second(), state.unit.name);
  if (state.unit.has_bytes) line += fmt::format(", {:.1f} MB/s", state.megabytes_per_second());
  return line;
}

std::string progress_json(const ProgressState& state) {
  nlohmann::json json = {{"event", "progress"},
                         {"done", state.done},
                         {"total", state.total},
                         {"quarantined", state.quarantined},
                         {"seconds", state.seconds},
                         {state.unit.name + "_per_s", state.per_second()},
                         {"seconds_left", state.seconds_left()}};
  if (!state.unit.phase.empty()) json["phase"] = state.unit.phase;
  if (state.unit.has_bytes) {
    json["bytes"] = state.bytes;
    json["mb_per_s"] = state.megabytes_per_second();
  }
  return dump_json(json);
}

Progress::Progress(std::ostream& stream, ProgressStyle style, ProgressDisplay::Columns columns,
                   std::int64_t total, Clock clock, ProgressUnit unit)
    : total_(total),
      state_{.unit = std::move(unit)},
      display_(stream, style, std::move(columns), std::move(clock),
               [this](std::chrono::steady_clock::time_point now) {
                 state_.total = total_;
                 state_.seconds = std::chrono::duration<double>(now - display_.start()).count();
                 return ProgressText{state_.done, state_.total, progress_line(state_),
                                     progress_json(state_)};
               }) {}

void Progress::advance(bool quarantined, std::int64_t bytes) {
  display_.update([&](auto) {
    ++state_.done;
    state_.quarantined += quarantined;
    state_.bytes += bytes;
  });
}

void Progress::finish() { display_.finish(/*passing=*/!state_.unit.phase.empty()); }

}  // namespace eventgan
