#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"
#include "pipeline/training/run_training.h"

namespace eventgan {

std::string to_text(const TrainingReport& report) {
  std::string text = fmt::format(
      "{}: {}\n"
      "  next step   {} {}\n"
      "  this run    {} steps in {:.0f} s, {:.0f} s with earlier runs\n",
      report.complete ? "complete" : "stopped, run again to go on", report.folder,
      to_string(report.position.phase), report.position.step, report.steps_made, report.run_seconds,
      report.total_seconds);
  for (const auto& [name, value] : report.losses) {
    text += fmt::format("  {} {:.6g} (mean of the last steps)\n", name, value);
  }
  if (!report.weights.empty()) {
    text +=
        fmt::format("  weights     {}\n  SHA-256     {}\n", report.weights, report.weights_sha256);
  }
  return text;
}

std::string to_json(const TrainingReport& report) {
  const nlohmann::json json = {{"event", "report"},
                               {"folder", report.folder},
                               {"complete", report.complete},
                               {"phase", to_string(report.position.phase)},
                               {"next_step", report.position.step},
                               {"steps_made", report.steps_made},
                               {"run_seconds", report.run_seconds},
                               {"total_seconds", report.total_seconds},
                               {"losses", report.losses},
                               {"weights", report.weights},
                               {"weights_sha256", report.weights_sha256}};
  return dump_json(json) + "\n";
}

}  // namespace eventgan
