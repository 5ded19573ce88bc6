#include "pipeline/runtime/progress.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "manifests/documents/json_text_internal.h"

namespace eventgan {
namespace {

constexpr int kBarWidth = 30;

ProgressStyle resolved(ProgressStyle style, bool is_terminal) {
  if (style != ProgressStyle::kAuto) return style;
  return is_terminal ? ProgressStyle::kBar : ProgressStyle::kLines;
}

std::chrono::milliseconds interval(ProgressStyle style) {
  switch (style) {
    case ProgressStyle::kBar:
      return std::chrono::milliseconds(100);
    case ProgressStyle::kJson:
      return std::chrono::seconds(1);
    default:
      return std::chrono::seconds(10);
  }
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

ProgressDisplay::ProgressDisplay(std::ostream& stream, ProgressStyle style, bool is_terminal,
                                 int bar_width, Clock clock)
    : stream_(stream),
      style_(resolved(style, is_terminal)),
      bar_width_(bar_width),
      clock_(std::move(clock)),
      start_(clock_()),
      shown_(start_) {}

bool ProgressDisplay::is_due() const { return clock_() - shown_ >= interval(style_); }

void ProgressDisplay::show(std::chrono::steady_clock::time_point now, std::int64_t done,
                           std::int64_t total, const std::string& line, const std::string& json) {
  shown_ = now;
  if (style_ == ProgressStyle::kBar) {
    std::string text = progress_bar(done, total, bar_width_) + " " + line;
    widest_ = std::max(widest_, text.size());
    text.resize(std::max(widest_, text.size() + 3), ' ');  // wipes what a longer line left behind
    stream_ << '\r' << text << std::flush;
  } else if (style_ != ProgressStyle::kNone) {
    stream_ << (style_ == ProgressStyle::kJson ? json : line) << std::endl;
  }
}

void ProgressDisplay::end_line() {
  if (std::exchange(widest_, 0) > 0) stream_ << std::endl;
}

std::string progress_bar(std::int64_t done, std::int64_t total, int width) {
  const auto filled = static_cast<std::size_t>(total > 0 ? width * done / total : 0);
  return fmt::format("[{:.<{}}]", std::string(filled, '#'), width);
}

std::string progress_line(const ProgressState& state) {
  std::string line = fmt::format("{0}/{1} {2}, {3:.2f} {2}/s, ", state.done, state.total,
                                 state.unit.name, state.per_second());
  if (state.unit.has_bytes) line += fmt::format("{:.1f} MB/s, ", state.megabytes_per_second());
  line += (state.done > 0 ? duration_text(state.seconds_left(), "hm") : "?") + " left";
  if (state.quarantined > 0) line += fmt::format(", {} quarantined", state.quarantined);
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
  if (state.unit.has_bytes) {
    json["bytes"] = state.bytes;
    json["mb_per_s"] = state.megabytes_per_second();
  }
  return dump_json(json);
}

Progress::Progress(std::ostream& stream, ProgressStyle style, bool is_terminal, std::int64_t total,
                   Clock clock, ProgressUnit unit)
    : display_(stream, style, is_terminal, kBarWidth, std::move(clock)) {
  state_.total = total;
  state_.unit = std::move(unit);
}

void Progress::advance(bool quarantined, std::int64_t bytes) {
  ++state_.done;
  state_.quarantined += quarantined;
  state_.bytes += bytes;
  if (display_.is_due()) show();
}

void Progress::finish() {
  show();
  display_.end_line();
}

void Progress::show() {
  const auto now = display_.now();
  state_.seconds = std::chrono::duration<double>(now - display_.start()).count();
  display_.show(now, state_.done, state_.total, progress_line(state_), progress_json(state_));
}

}  // namespace eventgan
