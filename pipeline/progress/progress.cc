#include "pipeline/progress/progress.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <ostream>

namespace eventgan {
namespace {

constexpr int kBarWidth = 30;

std::string duration_text(double seconds) {
  const auto whole = static_cast<long long>(seconds + 0.5);
  char text[64];
  if (whole >= 3600) {
    std::snprintf(text, sizeof text, "%lldh%02lldm", whole / 3600, whole / 60 % 60);
  } else {
    std::snprintf(text, sizeof text, "%lldm%02llds", whole / 60, whole % 60);
  }
  return text;
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

std::string event_json(const char* event, const std::string& text) {
  const nlohmann::json json = {{"event", event}, {"text", text}};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

std::string progress_line(const ProgressState& state) {
  const char* unit = state.unit.name.c_str();
  char text[160];
  std::snprintf(text, sizeof text, "%lld/%lld %s, %.2f %s/s, ", static_cast<long long>(state.done),
                static_cast<long long>(state.total), unit, state.per_second(), unit);
  std::string line = text;
  if (state.unit.has_bytes) {
    std::snprintf(text, sizeof text, "%.1f MB/s, ", state.megabytes_per_second());
    line += text;
  }
  line += (state.done > 0 ? duration_text(state.seconds_left()) : "?") + " left";
  if (state.quarantined > 0) line += ", " + std::to_string(state.quarantined) + " quarantined";
  return line;
}

std::string progress_bar(const ProgressState& state, int width) {
  const auto filled =
      state.total > 0 ? static_cast<std::size_t>(width * state.done / state.total) : 0;
  return "[" + std::string(filled, '#') +
         std::string(static_cast<std::size_t>(width) - filled, '.') + "] " + progress_line(state);
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
  return json.dump();
}

std::string error_json(const std::string& text) { return event_json("error", text); }

std::string warning_json(const std::string& text) { return event_json("warning", text); }

std::string note_json(const std::string& text) { return event_json("note", text); }

Progress::Progress(std::ostream& stream, ProgressStyle style, bool is_terminal, std::int64_t total,
                   Clock clock, ProgressUnit unit)
    : stream_(stream),
      style_(style != ProgressStyle::kAuto ? style
             : is_terminal                 ? ProgressStyle::kBar
                                           : ProgressStyle::kLines),
      clock_(std::move(clock)),
      start_(clock_()),
      shown_(start_) {
  state_.total = total;
  state_.unit = std::move(unit);
}

void Progress::advance(bool quarantined, std::int64_t bytes) {
  ++state_.done;
  state_.quarantined += quarantined;
  state_.bytes += bytes;
  if (clock_() - shown_ >= interval(style_)) show(false);
}

Progress::~Progress() {
  if (style_ == ProgressStyle::kBar && !finished_) stream_ << std::endl;
}

void Progress::finish() {
  finished_ = true;
  show(true);
}

void Progress::show(bool last) {
  shown_ = clock_();
  state_.seconds = std::chrono::duration<double>(shown_ - start_).count();
  switch (style_) {
    case ProgressStyle::kBar:
      // Trailing blanks wipe what a longer line left behind.
      stream_ << '\r' << progress_bar(state_, kBarWidth) << "   " << (last ? "\n" : "")
              << std::flush;
      break;
    case ProgressStyle::kLines:
      stream_ << progress_line(state_) << std::endl;
      break;
    case ProgressStyle::kJson:
      stream_ << progress_json(state_) << std::endl;
      break;
    default:
      break;
  }
}

}  // namespace eventgan
