#include "pipeline/conversion/conversion_report.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

constexpr std::size_t kListedFaults = 20;
constexpr double kMegabyte = 1e6;

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

double ratio(const ConversionReport& report) {
  return report.stored_bytes == 0 ? 0.0 : double(report.volume_bytes) / double(report.stored_bytes);
}

}  // namespace

std::string to_text(const ConversionReport& report) {
  std::string text =
      format("%lld of %lld pairs written, %zu quarantined, in %d of %d shards",
             static_cast<long long>(report.written), static_cast<long long>(report.planned),
             report.quarantined.size(), report.shards_done, report.shards_planned);
  if (report.shards_done_before > 0) text += format(" (%d done before)", report.shards_done_before);
  text += format("\n%.1f MB, volumes compressed %.1fx, %.1f s",
                 double(report.stored_bytes) / kMegabyte, ratio(report), report.wall_seconds);
  if (!report.stage_seconds.empty()) {
    text += "; busy seconds:";
    for (const auto& [stage, seconds] : report.stage_seconds) {
      text += format(" %s %.1f", stage.c_str(), seconds);
    }
  }
  if (report.without_partner > 0) {
    text += format("\n%lld labelled frames without a partner frame (listed in plan.json)",
                   static_cast<long long>(report.without_partner));
  }
  const std::size_t listed = std::min(report.quarantined.size(), kListedFaults);
  for (std::size_t i = 0; i < listed; ++i) text += "\nquarantined: " + report.quarantined[i].reason;
  if (listed < report.quarantined.size()) {
    text +=
        format("\n... and %zu more (in the shards' markers)", report.quarantined.size() - listed);
  }
  return text + "\n" + report.folder + "\n";
}

std::string to_json(const ConversionReport& report) {
  nlohmann::json quarantined = nlohmann::json::array();
  for (const QuarantinedSample& sample : report.quarantined) {
    quarantined.push_back({{"sample_id", sample.sample_id}, {"reason", sample.reason}});
  }
  const nlohmann::json json = {{"event", "report"},
                               {"folder", report.folder},
                               {"planned", report.planned},
                               {"written", report.written},
                               {"quarantined", quarantined},
                               {"without_partner", report.without_partner},
                               {"shards_planned", report.shards_planned},
                               {"shards_done", report.shards_done},
                               {"shards_done_before", report.shards_done_before},
                               {"stored_bytes", report.stored_bytes},
                               {"volume_bytes", report.volume_bytes},
                               {"compression_ratio", ratio(report)},
                               {"stage_seconds", report.stage_seconds},
                               {"wall_seconds", report.wall_seconds},
                               {"too_many_faults", report.too_many_faults}};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace eventgan
