#include "pipeline/dataset/finalize.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "manifests/documents/report.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/folder/shard_backup.h"

namespace eventgan {

namespace fs = std::filesystem;

namespace {

/// Looks at the shards once more, now that FOLDER/dataset.json names them: a `retry` or a `convert`
/// beside this, which outdates that of shards it changes, may have changed some before it was
/// there. Then this does, and throws std::runtime_error.
void require_unchanged(const fs::path& folder, const DatasetParts& parts) {
  for (const ShardState& shard : parts.done) {
    const ShardState now = shard_state(folder, shard.outline, parts.frozen.hash);
    if (now.done() && now.record->sha256 == shard.record->sha256) continue;
    outdate_dataset(folder, shard.outline.name);
    throw std::runtime_error(
        fmt::format("expected shards that nobody changes meanwhile, got {}, in {} (run eventgan "
                    "finalize again)",
                    now.done() ? "one that was committed again" : to_string(now.condition),
                    (folder / shard.outline.name).string()));
  }
}

}  // namespace

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
  report.notes = notes_of(parts.frozen.plan, parts.done);
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
  require_unchanged(folder, parts);
  return report;
}

namespace {

/// "missing", or what is wrong with what is there.
std::string why(const ShardState& shard) {
  return shard.faults.empty() ? to_string(shard.condition) : shard.faults.front();
}

std::string outcome_text(const FinalizationReport& report) {
  if (!report.written) {
    return report.counts.shards == 0 ? "not finalized: no shard is done"
                                     : "not finalized: incomplete (--partial to allow it)";
  }
  return (report.complete() ? "" : "PARTIAL: finalize again when the rest is done\n") +
         report.folder + ": " + kDescriptionName + ", " + kViewName;
}

Report table_of(const FinalizationReport& report) {
  constexpr std::ptrdiff_t kListed = 100;
  const DatasetCounts& counts = report.counts;
  return {{"missing",
           json_list(report.missing,
                     [](const ShardState& shard) -> nlohmann::json {
                       return {{"shard", shard.outline.name}, {"why", why(shard)}};
                     }),
           listed(report.missing, kListed, " (--json lists them)",
                  [](const ShardState& shard) {  // what is wrong with a shard names its file
                    return (shard.faults.empty() ? shard.outline.name + ": " : "") + why(shard);
                  })},
          {"shards_planned", report.shards_planned},
          {"shards_done", counts.shards},
          {"samples", counts.samples},
          {"valid", counts.valid},
          {"quarantined", counts.quarantined()},
          {"boxes", counts.boxes},
          {"persons", counts.persons},
          fmt::format("{} of {}: {}", counts.shards, count_text(report.shards_planned, "shard"),
                      contents_text(counts)),
          {"notes", report.notes, notes_text(report.notes)},
          {"folder", report.folder},
          {"written", report.written},
          {"complete", report.complete()},
          {"views", report.views},
          {"too_many_faults", report.too_many_faults},
          outcome_text(report)};
}

}  // namespace

std::string to_text(const FinalizationReport& report) { return text_of(table_of(report)); }
std::string to_json(const FinalizationReport& report) { return json_text_of(table_of(report)); }

}  // namespace eventgan
