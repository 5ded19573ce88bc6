#include "pipeline/folder/finalize.h"

#include <utility>

#include "manifests/error_limits.h"
#include "pipeline/folder/dataset_description.h"
#include "pipeline/folder/shard_backup.h"
#include "stages/files/atomic_file.h"

namespace eventgan {

FinalizationReport finalize(const std::filesystem::path& folder,
                            const FinalizationOptions& options) {
  FrozenOutline frozen = read_frozen_outline(folder);
  restore_shards(folder, frozen);  // and what a finalize that was killed has left goes
  std::vector<ShardState> shards =
      scan_shards(folder, frozen.plan.shards, frozen.hash, ScanDepth::kRows);
  const DatasetParts parts = read_dataset_parts(folder, std::move(frozen), std::move(shards));
  FinalizationReport report;
  report.folder = folder.string();
  report.shards_planned = static_cast<int>(parts.frozen.plan.shards.size());
  report.missing = parts.missing;
  report.notes = notes_of(parts.frozen.plan.sources);
  for (const ShardState& shard : parts.done) add(*shard.marker, report.counts);
  report.too_many_faults =
      beyond_limits(options.errors.value_or(parts.manifest.errors), report.counts.quarantined(),
                    parts.frozen.plan.sample_count());
  if (parts.done.empty() || (!report.complete() && !options.partial)) return report;

  const std::vector<DatasetView> views = views_of(parts);
  const ViewReceipt receipt = write_dataset_view(folder / kViewName, views);
  write_file_atomically(folder / kDescriptionName, describe_dataset(parts, views, receipt));
  report.views = static_cast<int>(views.size());
  report.written = true;
  return report;
}

}  // namespace eventgan
