#include "pipeline/dataset/finalize.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/folder/shard_backup.h"

namespace eventgan {

namespace fs = std::filesystem;

FinalizationReport finalize(const std::filesystem::path& folder,
                            const FinalizationOptions& options) {
  FrozenOutline frozen = read_frozen_outline(folder);
  require_own_results(folder);
  restore_shards(folder, frozen);  // and what a finalize that was killed has left goes
  std::vector<ShardState> shards =
      scan_shards(folder, frozen.plan.shards, frozen.hash, ScanDepth::kRows,
                  {.show_phase = options.show_phase});
  const DatasetParts parts = read_dataset_parts(folder, std::move(frozen), std::move(shards));
  FinalizationReport report;
  report.folder = folder.string();
  report.shards_planned = static_cast<int>(parts.frozen.plan.shards.size());
  report.missing = parts.missing;
  report.notes = notes_of(parts.frozen.plan.sources, unknown_places(parts.frozen.plan, parts.done));
  for (const ShardState& shard : parts.done) add(*shard.record, report.counts);
  report.too_many_faults =
      beyond_limits(options.errors.value_or(parts.manifest.errors), report.counts.quarantined(),
                    parts.frozen.plan.sample_count());
  if (parts.done.empty() || (!report.complete() && !options.partial)) return report;

  const std::vector<DatasetView> views = views_of(parts);
  report.views = static_cast<int>(views.size());
  report.written = true;
  const fs::path description = folder / kDescriptionName;
  if (fs::exists(description) && fs::exists(folder / kViewName) &&
      read_text_file(description) == describe_present_view(folder, parts)) {
    return report;  // the same shards: nothing is touched
  }
  const ViewReceipt receipt = write_dataset_view(folder / kViewName, views);
  write_file_atomically(description, describe_dataset(parts, views, receipt));
  return report;
}

namespace {

constexpr std::size_t kListedShards = 100;

/// "missing", or what is wrong with what is there.
std::string why(const ShardState& shard) {
  return shard.faults.empty() ? to_string(shard.condition) : shard.faults.front();
}

}  // namespace

std::string to_text(const FinalizationReport& report) {
  std::string text;
  const std::size_t listed = std::min(report.missing.size(), kListedShards);
  for (std::size_t i = 0; i < listed; ++i) {
    const ShardState& shard = report.missing[i];
    // What is wrong with a shard names its file.
    text += escape_controls((shard.faults.empty() ? shard.outline.name + ": " : "") + why(shard)) +
            "\n";
  }
  if (listed < report.missing.size()) {
    text += fmt::format("... and {} more (--json lists them)\n", report.missing.size() - listed);
  }
  const DatasetCounts& counts = report.counts;
  text += fmt::format("{} of {}: {}\n", counts.shards, count_text(report.shards_planned, "shard"),
                      contents_text(counts));
  text += notes_text(report.notes);
  if (!report.written) {
    return text + (counts.shards == 0 ? "not finalized: no shard is done\n"
                                      : "not finalized: incomplete (--partial to allow it)\n");
  }
  if (!report.complete()) text += "PARTIAL: finalize again when the rest is done\n";
  return text + report.folder + ": " + kDescriptionName + ", " + kViewName + "\n";
}

std::string to_json(const FinalizationReport& report) {
  nlohmann::json missing = nlohmann::json::array();
  for (const ShardState& shard : report.missing) {
    missing.push_back({{"shard", shard.outline.name}, {"why", why(shard)}});
  }
  const nlohmann::json json = {{"folder", report.folder},
                               {"complete", report.complete()},
                               {"written", report.written},
                               {"shards_planned", report.shards_planned},
                               {"shards_done", report.counts.shards},
                               {"missing", missing},
                               {"samples", report.counts.samples},
                               {"valid", report.counts.valid},
                               {"quarantined", report.counts.quarantined()},
                               {"boxes", report.counts.boxes},
                               {"persons", report.counts.persons},
                               {"notes", report.notes},
                               {"views", report.views},
                               {"too_many_faults", report.too_many_faults}};
  return dump_json(json) + "\n";
}

}  // namespace eventgan
