#include "pipeline/training/training_progress.h"

#include <fmt/core.h>

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {
namespace {

constexpr int kBarWidth = 20;

/// The losses of a line in words: more would not fit it.
constexpr std::array<const char*, 4> kShown{"flow", "reconstruction", "generator.total",
                                            "discriminator"};

}  // namespace

TrainingProgress::TrainingProgress(std::ostream& stream, ProgressStyle style, bool is_terminal,
                                   Clock clock)
    : display_(stream, style, is_terminal, kBarWidth, std::move(clock)), start_(display_.now()) {}

void TrainingProgress::advance(TrainingPhase phase, std::int64_t done, std::int64_t total,
                               const std::map<std::string, double>& losses) {
  if (first_ < 0 || phase != phase_) {
    // The step that was just made belongs to the phase; its time does not: it ran before.
    start_ = display_.now();
    first_ = done;
    losses_.clear();
  }
  phase_ = phase;
  done_ = done;
  total_ = total;
  for (const auto& [name, value] : losses) losses_[name] = value;
  if (display_.is_due() || done == total) show();
}

void TrainingProgress::show() {
  const double seconds = std::chrono::duration<double>(display_.now() - start_).count();
  const double rate = seconds > 0 ? static_cast<double>(done_ - first_) / seconds : 0;
  std::string line = fmt::format(
      "{} {}/{}, {:.2f} steps/s, {} left", to_string(phase_), done_, total_, rate,
      rate > 0 ? duration_text(static_cast<double>(total_ - done_) / rate, "h", 3) : "?");
  for (const char* name : kShown) {
    const auto found = losses_.find(name);
    if (found != losses_.end()) line += fmt::format(", {} {:.4g}", name, found->second);
  }
  display_.show(done_, total_, line,
                dump_json(nlohmann::json{{"event", "progress"},
                                         {"phase", to_string(phase_)},
                                         {"done", done_},
                                         {"total", total_},
                                         {"steps_per_s", rate},
                                         {"losses", losses_}}));
}

}  // namespace eventgan
