#include "pipeline/training/report/training_report.h"

#include <fmt/core.h>

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "manifests/documents/report.h"
#include "manifests/values/text.h"

namespace eventgan {
namespace {

/// The losses of a line in words: more would not fit it.
constexpr std::array<const char*, 4> kShown{"flow", "reconstruction", "generator.total",
                                            "discriminator"};

}  // namespace

TrainingProgress::TrainingProgress(std::ostream& stream, ProgressStyle style,
                                   ProgressDisplay::Columns columns, Clock clock)
    : display_(stream, style, std::move(columns), std::move(clock),
               [this](std::chrono::steady_clock::time_point now) { return describe(now); }) {}

void TrainingProgress::advance(TrainingPhase phase, std::int64_t done, std::int64_t total,
                               const std::map<std::string, double>& losses) {
  display_.update(
      [&](std::chrono::steady_clock::time_point now) {
        if (first_ < 0 || phase != phase_) {
          // The step that was just made belongs to the phase; its time does not: it ran before.
          start_ = now;
          first_ = done;
          losses_.clear();
        }
        phase_ = phase;
        done_ = done;
        total_ = total;
        for (const auto& [name, value] : losses) losses_[name] = value;
      },
      /*at_once=*/done == total);
  if (std::exchange(keeps_up_, false)) display_.keep_up();
}

ProgressText TrainingProgress::describe(std::chrono::steady_clock::time_point now) const {
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double rate = seconds > 0 ? static_cast<double>(done_ - first_) / seconds : 0;
  std::string line = fmt::format(
      "{} {}/{}, {} left, {:.2f} steps/s", to_string(phase_), done_, total_,
      rate > 0 ? duration_text(static_cast<double>(total_ - done_) / rate, "h", 3) : "?", rate);
  for (const char* name : kShown) {
    const auto found = losses_.find(name);
    if (found != losses_.end()) line += fmt::format(", {} {:.4g}", name, found->second);
  }
  return {done_, total_, line,
          dump_json(nlohmann::json{{"event", "progress"},
                                   {"phase", to_string(phase_)},
                                   {"done", done_},
                                   {"total", total_},
                                   {"steps_per_s", rate},
                                   {"losses", losses_}})};
}

namespace {

Report table_of(const TrainingReport& report) {
  return {{"event", "report"},
          {"folder", report.folder,
           (report.complete ? "complete: " : "stopped, run again to resume: ") + report.folder},
          {"complete", report.complete},
          {"phase", to_string(report.position.phase),
           fmt::format("  {}  {} {}", report.complete ? "steps done" : "next step ",
                       to_string(report.position.phase), report.position.step)},
          {"next_step", report.position.step},
          fmt::format("  this run    {} steps in {:.0f} s, {:.0f} s with earlier runs",
                      report.steps_made, report.run_seconds, report.total_seconds),
          {"steps_made", report.steps_made},
          {"run_seconds", report.run_seconds},
          {"total_seconds", report.total_seconds},
          {"losses", report.losses,
           joined(report.losses, "",
                  [](const auto& loss) {
                    return fmt::format("  {} {:.6g} (mean of the last steps)\n", loss.first,
                                       loss.second);
                  })},
          {"weights", report.weights, "  weights     " + report.weights},
          {"weights_sha256", report.weights_sha256, "  SHA-256     " + report.weights_sha256}};
}

}  // namespace

std::string to_text(const TrainingReport& report) { return text_of(table_of(report)); }
std::string to_json(const TrainingReport& report) { return json_text_of(table_of(report)); }

}  // namespace eventgan
