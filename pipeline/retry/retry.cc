#include "pipeline/retry/retry.h"

#include <chrono>
#include <cstddef>
#include <iterator>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "manifests/error_limits.h"
#include "manifests/faults.h"
#include "manifests/plan_outline.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/folder/shard_backup.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/profile/trace_span.h"
#include "pipeline/retry/retry_work.h"
#include "pipeline/retry/shard_rewrite.h"
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

PlannedJob plan_again(const JobManifest& manifest, const std::string& weights_hash,
                      const std::string& engine, const RunOptions& options) {
  return make_plan(
      manifest, weights_hash, engine, [&] { return options.stop_requested(); }, options.trace);
}

/// The shards with quarantined samples that prove whole; the others are reported. After a request
/// to stop there may be fewer.
std::vector<CommittedShard> trusted_shards(const fs::path& folder, const FrozenPlan& frozen,
                                           const QuarantinedSamples& found,
                                           const RunOptions& options, RetryReport& report) {
  std::vector<const PlannedShard*> shards;
  for (const std::size_t shard : found.shards) shards.push_back(&frozen.plan.shards[shard]);
  EarlierShards earlier = check_earlier_shards(
      folder, frozen, shards,
      {thread_count(options.threads), [&] { return options.stop_requested(); }, options.trace});
  for (const std::string& fault : earlier.faults) report.damaged_shards.push_back(fault);
  if (!options.stop_requested()) {
    report.quarantined = 0;  // what a damaged shard held does not count
    for (const CommittedShard& shard : earlier.done) {
      report.quarantined += std::ssize(shard.marker.quarantined);
    }
  }
  return std::move(earlier.done);
}

/// Puts redone samples into their committed shards; for each shard once it is through, `report`
/// gets tried, mended, failed, shards_rewritten and what is quarantined still.
class RetrySink final : public SampleSink {
 public:
  /// Takes what plan_retry made of `shards`, in their order. All must outlive the sink.
  RetrySink(const fs::path& folder, const std::vector<CommittedShard>& shards, RetryReport& report,
            TraceRecorder* trace)
      : folder_(folder), next_(shards.begin()), report_(report), trace_(trace) {}

  void open(const PlannedShard& shard) override {
    marker_ = &(next_++)->marker;
    rewrite_ = std::make_unique<ShardRewrite>(
        folder_, *marker_, shard.size_unknown ? std::optional(shard.volume_size) : std::nullopt);
  }

  void add(const SampleMessage& message) override {
    const int slot = marker_->quarantined.at(static_cast<std::size_t>(message.slot)).slot;
    rewrite_->redo(slot, message);
    if (!message.failed()) return;
    failed_.push_back({marker_->shard, slot, message.sample.sample_id, message.sample.fault});
  }

  bool commit() override {
    TraceSpan span(trace_, "commit shard", "shard");
    span.note("shard", marker_->shard);
    report_.shards_rewritten += rewrite_->commit();
    rewrite_.reset();
    const std::int64_t tried = std::ssize(marker_->quarantined);
    const std::int64_t mended = tried - std::ssize(failed_);
    report_.tried += tried;
    report_.mended += mended;
    report_.quarantined -= mended;
    report_.failed.insert(report_.failed.end(), failed_.begin(), failed_.end());
    failed_.clear();
    return true;
  }

  /// The samples of the shard under way do not count as tried.
  void abandon() override {
    rewrite_.reset();
    failed_.clear();
  }

  bool closed() const override { return false; }

 private:
  const fs::path& folder_;
  std::vector<CommittedShard>::const_iterator next_;
  const ShardMarker* marker_ = nullptr;    // of the shard under way
  std::unique_ptr<ShardRewrite> rewrite_;  // of the shard under way
  std::vector<QuarantinedSlot> failed_;         // of the shard under way
  RetryReport& report_;
  TraceRecorder* trace_;
};

}  // namespace

std::optional<RetryReport> nothing_to_retry(const fs::path& folder, const FrozenOutline& frozen,
                                            const JobManifest& manifest,
                                            const RunOptions& options) {
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
                  const std::string& weights_hash, const RunOptions& options) {
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

  const std::vector<CommittedShard> shards = trusted_shards(folder, frozen, found, options, report);
  std::vector<PlannedShard> retried = plan_retry(shards);
  std::vector<const PlannedShard*> to_redo;
  for (std::size_t i = 0; i < shards.size(); ++i) {
    to_redo.push_back(&retried[i]);
    // A shard that has good samples already has the size of these.
    if (!retried[i].size_unknown || shards[i].marker.valid == 0) continue;
    retried[i].volume_size = ShardReader(folder / retried[i].name).header().volume.size;
  }
  const std::int64_t to_do = report.quarantined;
  RetrySink sink(folder, shards, report, options.trace);
  run_conversion("redo samples",
                 {manifest, job.datasets, generator, weights_hash, folder, frozen, options},
                 to_redo, sink);
  report.stopped = options.stop_requested() && report.tried < to_do;
  report.dataset_outdated = report.shards_rewritten > 0 && fs::exists(folder / "dataset.json");
  report.too_many_faults = beyond_limits(manifest.errors, report.quarantined, report.planned);
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace eventgan
