#include "pipeline/retry/retry_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {
namespace {

constexpr std::size_t kListedSamples = 20;

std::string count(std::int64_t number, const std::string& what) {
  return fmt::format("{} {}{}", number, what, number == 1 ? "" : "s");
}

}  // namespace

std::string to_text(const RetryReport& report) {
  std::string text;
  for (const std::string& fault : report.damaged_shards) {
    text += fault + "; left to convert\n";
  }
  if (report.shards_missing > 0) {
    text += count(report.shards_missing, "shard") + " not made yet: left to convert\n";
  }
  if (!report.changed_inputs.empty()) {
    text += "inputs changed since the plan was frozen (";
    for (const std::string& field : report.changed_inputs) {
      text += (field == report.changed_inputs.front() ? "" : ", ") + field;
    }
    text += "): recorded, convert goes on with them\n";
  }
  if (report.tried == 0 && report.quarantined == 0) {
    text += "nothing to retry: no sample of a committed shard is quarantined\n";
  } else {
    text +=
        fmt::format("{} of {} mended, {} written again; {} of {} samples are quarantined still\n",
                    report.mended, count(report.tried, "quarantined sample"),
                    count(report.shards_rewritten, "shard"), report.quarantined, report.planned);
  }
  const std::size_t listed = std::min(report.failed.size(), kListedSamples);
  for (std::size_t i = 0; i < listed; ++i) {
    text += "quarantined: " + report.failed[i].reason + "\n";
  }
  if (listed < report.failed.size()) {
    text +=
        fmt::format("... and {} more (in the shards' markers)\n", report.failed.size() - listed);
  }
  if (report.dataset_outdated) {
    text += "dataset.json tells of the shards as they were: eventgan finalize writes it anew\n";
  }
  if (report.stopped) text += "stopped before all were tried: run again\n";
  return text + report.folder + "\n";
}

std::string to_json(const RetryReport& report) {
  nlohmann::json failed = nlohmann::json::array();
  for (const QuarantinedSlot& sample : report.failed) {
    failed.push_back({{"sample_id", sample.sample_id},
                      {"shard", sample.shard},
                      {"slot", sample.slot},
                      {"reason", sample.reason}});
  }
  const nlohmann::json json = {{"event", "report"},
                               {"folder", report.folder},
                               {"planned", report.planned},
                               {"tried", report.tried},
                               {"mended", report.mended},
                               {"failed", failed},
                               {"quarantined", report.quarantined},
                               {"shards_rewritten", report.shards_rewritten},
                               {"damaged_shards", report.damaged_shards},
                               {"shards_missing", report.shards_missing},
                               {"changed_inputs", report.changed_inputs},
                               {"stopped", report.stopped},
                               {"too_many_faults", report.too_many_faults},
                               {"dataset_outdated", report.dataset_outdated},
                               {"wall_seconds", report.wall_seconds}};
  return dump_json(json) + "\n";
}

}  // namespace eventgan
