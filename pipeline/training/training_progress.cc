#include "pipeline/training/training_progress.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <ostream>

namespace eventgan {
namespace {

constexpr int kBarWidth = 20;

/// The losses of a line in words: more would not fit it.
constexpr std::array<const char*, 4> kShown{"flow", "reconstruction", "generator.total",
                                            "discriminator"};

std::chrono::milliseconds interval(ProgressStyle style) {
  return style == ProgressStyle::kBar    ? std::chrono::milliseconds(250)
         : style == ProgressStyle::kJson ? std::chrono::milliseconds(1000)
                                         : std::chrono::milliseconds(10000);
}

std::string time_text(double seconds) {
  const auto whole = static_cast<long long>(seconds + 0.5);
  char text[64];
  std::snprintf(text, sizeof text, "%lldh%02lldm%02llds", whole / 3600, whole / 60 % 60,
                whole % 60);
  return text;
}

}  // namespace

TrainingProgress::TrainingProgress(std::ostream& stream, ProgressStyle style, bool is_terminal,
                                   Clock clock)
    : stream_(stream),
      style_(style != ProgressStyle::kAuto ? style
             : is_terminal                 ? ProgressStyle::kBar
                                           : ProgressStyle::kLines),
      clock_(std::move(clock)),
      start_(clock_()),
      shown_(start_) {}

TrainingProgress::~TrainingProgress() {
  if (style_ == ProgressStyle::kBar && widest_ > 0) stream_ << std::endl;
}

void TrainingProgress::advance(TrainingPhase phase, std::int64_t done, std::int64_t total,
                               const std::map<std::string, double>& losses) {
  if (first_ < 0 || phase != phase_) {
    // The step that was just made belongs to the phase; its time does not: it ran before.
    start_ = clock_();
    first_ = done;
    losses_.clear();
  }
  phase_ = phase;
  done_ = done;
  total_ = total;
  for (const auto& [name, value] : losses) losses_[name] = value;
  if (clock_() - shown_ >= interval(style_) || done == total) show();
}

double TrainingProgress::steps_per_second() const {
  const double seconds = std::chrono::duration<double>(clock_() - start_).count();
  return seconds > 0 ? static_cast<double>(done_ - first_) / seconds : 0;
}

std::string TrainingProgress::line() const {
  const double rate = steps_per_second();
  char text[160];
  std::snprintf(text, sizeof text, "%s %lld/%lld, %.2f steps/s, %s left",
                std::string(to_string(phase_)).c_str(), static_cast<long long>(done_),
                static_cast<long long>(total_), rate,
                rate > 0 ? time_text(static_cast<double>(total_ - done_) / rate).c_str() : "?");
  std::string line = text;
  for (const char* name : kShown) {
    const auto found = losses_.find(name);
    if (found == losses_.end()) continue;
    std::snprintf(text, sizeof text, ", %s %.4g", name, found->second);
    line += text;
  }
  return line;
}

std::string TrainingProgress::json_line() const {
  const nlohmann::json json = {
      {"event", "progress"}, {"phase", to_string(phase_)},        {"done", done_},
      {"total", total_},     {"steps_per_s", steps_per_second()}, {"losses", losses_}};
  return json.dump();
}

void TrainingProgress::show() {
  shown_ = clock_();
  switch (style_) {
    case ProgressStyle::kBar: {
      const auto filled =
          total_ > 0 ? static_cast<std::size_t>(kBarWidth * done_ / total_) : std::size_t{0};
      std::string text =
          "[" + std::string(filled, '#') + std::string(kBarWidth - filled, '.') + "] " + line();
      widest_ = std::max(widest_, text.size());
      text.resize(widest_, ' ');  // wipes what a longer line left behind
      stream_ << '\r' << text << std::flush;
      break;
    }
    case ProgressStyle::kLines:
      stream_ << line() << std::endl;
      break;
    case ProgressStyle::kJson:
      stream_ << json_line() << std::endl;
      break;
    default:
      break;
  }
}

}  // namespace eventgan
