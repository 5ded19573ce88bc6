#include "pipeline/retry/retry.h"

#include <chrono>
#include <map>
#include <utility>
#include <vector>

#include "manifests/error_limits.h"
#include "manifests/faults.h"
#include "manifests/plan_outline.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/folder/shard_backup.h"
#include "pipeline/memory/memory_limit.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/profile/trace_span.h"
#include "pipeline/retry/retry_sink.h"
#include "pipeline/retry/retry_work.h"
#include "pipeline/samples/conversion_graph.h"
#include "pipeline/samples/graph_limits.h"
#include "pipeline/samples/sample_stages.h"
#include "pipeline/stopping/shard_pace.h"
#include "pipeline/stopping/stop_monitor.h"
#include "pipeline/threads/thread_count.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using Fingerprint = std::map<std::string, std::string>;

RetryReport new_report(const fs::path& folder, const QuarantinedSamples& found,
                       std::int64_t planned) {
  RetryReport report;
  report.folder = folder.string();
  report.planned = planned;
  report.quarantined = found.count;
  report.damaged_shards = found.damaged;
  report.shards_missing = found.shards_missing;
  return report;
}

/// The amendable fields in which the inputs differ now. Throws UsageError if other fields do.
Fingerprint changed_inputs(const fs::path& folder, Fingerprint accepted, const Fingerprint& now) {
  Fingerprint changed;
  for (const auto& [field, value] : now) {
    if (!is_amendable(field) || accepted[field] == value) continue;
    changed[field] = accepted[field] = value;
  }
  const auto differences = fingerprint_differences(accepted, now);
  if (differences.empty()) return changed;
  std::string message = "expected the job that " + (folder / "plan.json").string() +
                        " was frozen by, its inputs mended, got another one:";
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

/// Records which inputs have changed, before the samples `ids` are redone, and where the inputs are
/// now.
void accept_inputs(const fs::path& folder, const std::string& plan_hash, const Fingerprint& frozen,
                   const Fingerprint& now, const JobManifest& manifest,
                   const std::vector<std::string>& ids, RetryReport& report) {
  const Fingerprint changed =
      changed_inputs(folder, amended(frozen, read_amendments(folder, plan_hash)), now);
  if (!changed.empty()) record_amendment(folder, plan_hash, {changed, ids});
  for (const auto& [field, value] : changed) report.changed_inputs.push_back(field);
  if (recorded_manifest_folder(folder) != manifest.directory) {
    record_manifest_folder(folder, manifest);
  }
}

bool stop_requested(const RetryOptions& options) {
  return options.since_stop_request && options.since_stop_request().has_value();
}

PlannedJob plan_again(const JobManifest& manifest, const std::string& weights_hash,
                      const std::string& engine, const RetryOptions& options) {
  return make_plan(
      manifest, weights_hash, engine, [&] { return stop_requested(options); }, options.trace);
}

/// A shard that has good samples already has the size of these.
void keep_sizes(const fs::path& folder, std::vector<RetriedShard>& shards) {
  for (RetriedShard& shard : shards) {
    if (!shard.samples.size_unknown || shard.marker.valid == 0) continue;
    shard.samples.volume_size = ShardReader(folder / shard.marker.shard).header().volume.size;
  }
}

/// The shards with quarantined samples that prove whole; the others are reported. After a request
/// to stop there may be fewer.
std::vector<CommittedShard> trusted_shards(const fs::path& folder, const FrozenPlan& frozen,
                                           const QuarantinedSamples& found,
                                           const RetryOptions& options, RetryReport& report) {
  std::vector<const PlannedShard*> shards;
  for (const std::size_t shard : found.shards) shards.push_back(&frozen.plan.shards[shard]);
  EarlierShards earlier = check_earlier_shards(
      folder, frozen, shards,
      {thread_count(options.threads), [&] { return stop_requested(options); }, options.trace});
  for (const std::string& fault : earlier.faults) report.damaged_shards.push_back(fault);
  if (!stop_requested(options)) {
    report.quarantined = 0;  // what a damaged shard held does not count
    for (const CommittedShard& shard : earlier.done) {
      report.quarantined += std::ssize(shard.marker.quarantined);
    }
  }
  return std::move(earlier.done);
}

/// Runs the samples through the stages and into their shards.
void redo(const fs::path& folder, const JobManifest& manifest, const PlannedJob& job,
          const Generator& generator, const std::vector<RetriedShard>& shards,
          const RetryOptions& options, RetryReport& report) {
  std::vector<const PlannedShard*> samples;
  std::int64_t to_do = 0;
  for (const RetriedShard& shard : shards) {
    samples.push_back(&shard.samples);
    to_do += std::ssize(shard.slots);
  }
  check_pairs_fit(samples, generator, memory_limit_bytes());
  const GraphLimits limits =
      graph_limits(samples, generator, thread_count(options.threads), memory_limit_bytes());
  const SampleStages stages(manifest, job.datasets, generator, static_cast<int>(limits.in_flight));
  const std::unique_ptr<Progress> progress =
      options.make_progress && to_do > 0 ? options.make_progress(to_do) : nullptr;
  ShardPace pace(limits.threads);
  const StopMonitor monitor(options.since_stop_request, options.grace_s,
                            [&] { return pace.open_shard(); });
  RetrySink sink(folder, shards, pace, report, options.trace);
  auto next = samples.begin();
  const TraceSpan span(options.trace, "redo samples", "job");
  run_conversion_graph([&] { return next == samples.end() ? nullptr : *next++; },
                       {[&](SampleMessage& message) { stages.read(message); },
                        [&](SampleMessage& message) { stages.generate(message); },
                        [&](SampleMessage& message) { stages.finish(message); },
                        [&](SampleMessage& message) {
                          const StopOrder order = monitor.order();
                          if (order == StopOrder::kAbort) return false;
                          if (order == StopOrder::kFinishShard && !sink.is_open()) return false;
                          sink.accept(message);
                          if (progress)
                            progress->advance(message.failed(), std::ssize(message.chunk));
                          return true;
                        }},
                       limits, [&] { return monitor.order(); }, options.trace);
  sink.abandon();
  if (progress) progress->finish();
}

}  // namespace

std::optional<RetryReport> nothing_to_retry(const fs::path& folder, const FrozenOutline& frozen,
                                            const JobManifest& manifest,
                                            const RetryOptions& options) {
  restore_shards(folder, frozen);
  const QuarantinedSamples found = find_quarantined(folder, frozen);
  if (found.count > 0) return std::nullopt;
  RetryReport report = new_report(folder, found, frozen.plan.sample_count());
  const Fingerprint& before = frozen.plan.fingerprint;
  Fingerprint now = plan_again(manifest, "", "", options).plan.fingerprint;
  for (auto& [field, value] : now) {
    const auto known = before.find(field);
    if (known == before.end() || is_amendable(field) || field.starts_with("manifest ")) continue;
    value = known->second;  // weights, processor, libraries: for `convert` to compare
  }
  accept_inputs(folder, frozen.hash, before, now, manifest, {}, report);
  return report;
}

RetryReport retry(const fs::path& folder, const JobManifest& manifest, const Generator& generator,
                  const std::string& weights_hash, const RetryOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  FrozenPlan frozen = read_frozen_plan(folder);
  const FrozenOutline outline{outline_of(frozen.plan), frozen.hash};
  restore_shards(folder, outline);
  const QuarantinedSamples found = find_quarantined(folder, outline);
  RetryReport report = new_report(folder, found, frozen.plan.sample_count());

  PlannedJob job = plan_again(manifest, weights_hash, generator.description(), options);
  accept_inputs(folder, frozen.hash, frozen.plan.fingerprint, job.plan.fingerprint, manifest,
                found.ids, report);
  job.plan = {};  // the frozen one counts, and it can be huge
  complete_plan(manifest, job.datasets, frozen.plan);
  std::vector<RetriedShard> shards =
      plan_retry(trusted_shards(folder, frozen, found, options, report));
  keep_sizes(folder, shards);
  const std::int64_t to_do = report.quarantined;
  redo(folder, manifest, job, generator, shards, options, report);
  report.stopped = stop_requested(options) && report.tried < to_do;
  report.dataset_outdated = report.shards_rewritten > 0 && fs::exists(folder / "dataset.json");
  report.too_many_faults = beyond_limits(manifest.errors, report.quarantined, report.planned);
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace eventgan
