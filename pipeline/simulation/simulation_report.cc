#include "pipeline/simulation/simulation_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {
namespace {

/// All recordings as one; pixels and duration are those of one with the same events a pixel and
/// second.
RecordingSummary sum(const std::vector<RecordingSummary>& recordings) {
  RecordingSummary total;
  double pixel_seconds = 0;
  for (const RecordingSummary& recording : recordings) {
    total.frames += recording.frames;
    total.events += recording.events;
    total.displacement_px = std::max(total.displacement_px, recording.displacement_px);
    pixel_seconds += static_cast<double>(recording.pixels) * recording.duration_s;
  }
  total.name = "all";
  total.pixels = 1;
  total.duration_s = pixel_seconds;
  return total;
}

std::string table_line(const RecordingSummary& recording) {
  return fmt::format("{:24.200} {:8} {:12} {:10.3f} {:10.1f}\n", recording.name, recording.frames,
                     recording.events, recording.events_per_pixel_second(),
                     recording.displacement_px);
}

nlohmann::json summary_json(const RecordingSummary& recording) {
  return {{"name", recording.name},
          {"frames", recording.frames},
          {"events", recording.events},
          {"events_per_pixel_second", recording.events_per_pixel_second()},
          {"displacement_px", recording.displacement_px}};
}

}  // namespace

double RecordingSummary::events_per_pixel_second() const {
  const double pixel_seconds = static_cast<double>(pixels) * duration_s;
  return pixel_seconds > 0 ? static_cast<double>(events) / pixel_seconds : 0;
}

std::string to_text(const SimulationReport& report) {
  std::string text;
  if (!report.made.empty()) {
    text = fmt::format("{:24} {:>8} {:>12} {:>10} {:>10}\n", "recording", "frames", "events",
                       "per px s", "px a frame");
    for (const RecordingSummary& recording : report.made) text += table_line(recording);
  }
  const RecordingSummary total = sum(report.made);
  if (report.made.size() > 1) text += table_line(total);
  return text +
         fmt::format("{} recordings made, {} kept from before; {:.1f} s, {:.2f} s a frame\n{}\n",
                     report.made.size(), report.kept.size(), report.wall_seconds,
                     total.frames > 0 ? report.wall_seconds / static_cast<double>(total.frames) : 0,
                     report.folder);
}

std::string to_json(const SimulationReport& report) {
  nlohmann::json recordings = nlohmann::json::array();
  for (const RecordingSummary& recording : report.made) {
    recordings.push_back(summary_json(recording));
  }
  const nlohmann::json json = {{"event", "report"},
                               {"folder", report.folder},
                               {"made", recordings},
                               {"kept", report.kept},
                               {"total", summary_json(sum(report.made))},
                               {"wall_seconds", report.wall_seconds}};
  return dump_json(json) + "\n";
}

}  // namespace eventgan
