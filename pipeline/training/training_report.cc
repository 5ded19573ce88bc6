#include <cstdio>
#include <nlohmann/json.hpp>

#include "pipeline/training/records/csv_table.h"
#include "pipeline/training/run_training.h"

namespace eventgan {

std::string to_text(const TrainingReport& report) {
  char times[96];
  std::snprintf(times, sizeof times, "%.0f s, %.0f s with earlier runs", report.run_seconds,
                report.total_seconds);
  std::string text = std::string(report.complete ? "complete" : "stopped, run again to go on") +
                     ": " + report.folder + "\n  next step   " +
                     std::string(to_string(report.position.phase)) + ' ' +
                     std::to_string(report.position.step) + "\n  this run    " +
                     std::to_string(report.steps_made) + " steps in " + times + '\n';
  for (const auto& [name, value] : report.losses) {
    text += "  " + name + ' ' + csv_number(value) + " (mean of the last steps)\n";
  }
  if (!report.weights.empty()) {
    text += "  weights     " + report.weights + "\n  SHA-256     " + report.weights_sha256 + '\n';
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
  return json.dump() + '\n';
}

}  // namespace eventgan
