#include "pipeline/conversion/retry.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/documents/report.h"
#include "manifests/files/file_lock.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "pipeline/conversion/shard_rewrite.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/folder/shard_backup.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/runtime/trace.h"
#include "stages/frames/sources/class_numbers.h"
#include "stages/recordings/order/event_index.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {

QuarantinedSamples find_quarantined(const std::filesystem::path& folder,
                                    const FrozenOutline& frozen) {
  QuarantinedSamples found;
  const auto states = scan_shards(folder, frozen.plan.shards, frozen.hash);
  for (std::size_t i = 0; i < states.size(); ++i) {
    const ShardState& state = states[i];
    if (state.condition == ShardCondition::kMissing) ++found.shards_missing;
    found.damaged.insert(found.damaged.end(), state.faults.begin(), state.faults.end());
    if (!state.done() || state.record->quarantined.empty()) continue;
    found.shards.push_back(i);
    found.count += std::ssize(state.record->quarantined);
    for (const QuarantinedSample& sample : state.record->quarantined) {
      found.ids.push_back(sample.sample_id);
    }
  }
  return found;
}

std::vector<PlannedShard> plan_retry(const std::vector<CommittedShard>& shards) {
  std::vector<PlannedShard> retried;
  for (const CommittedShard& committed : shards) {
    const PlannedShard& whole = *committed.shard;
    PlannedShard& part = retried.emplace_back(
        PlannedShard{whole.name, whole.source, whole.volume_size, {}, whole.size_unknown});
    for (const QuarantinedSample& quarantined : committed.record.quarantined) {
      part.samples.push_back(whole.samples.at(static_cast<std::size_t>(quarantined.slot)));
    }
  }
  return retried;
}

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

/// Refuses labels whose numbers mean others than they did when shards were made.
void require_same_meanings(const fs::path& folder, const Fingerprint& accepted,
                           const Fingerprint& now) {
  Fingerprint were, are;
  for (const auto& [field, value] : accepted) {
    if (!is_addable(field)) continue;
    were[field] = value;
    if (const auto same = now.find(field); same != now.end()) are.insert(*same);
  }
  const auto differences = fingerprint_differences(were, are);
  if (differences.empty()) return;
  throw InputError(
      fmt::format("expected labels whose numbers mean what they did when shards were made, got "
                  "others, in {}: put new classes at the end and the others back, or make all "
                  "shards again (eventgan convert --overwrite):\n  {}",
                  folder.string(), fmt::join(differences, "\n  ")));
}

/// The fields in which the inputs differ now and may. Throws InputError if labels mean others,
/// UsageError if other fields differ.
Fingerprint changed_inputs(const fs::path& folder, Fingerprint accepted, const Fingerprint& now) {
  Fingerprint changed;
  for (const auto& [field, value] : now) {
    const bool may_differ = is_amendable(field) || (is_addable(field) && !accepted.contains(field));
    if (!may_differ || accepted[field] == value) continue;
    changed[field] = accepted[field] = value;
  }
  require_same_meanings(folder, accepted, now);
  const auto differences = fingerprint_differences(accepted, now);
  if (differences.empty()) return changed;
  std::string message = "expected the job of " + (folder / "plan.json").string() +
                        ", in which only inputs may have changed, got another one:";
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

PlannedJob plan_again(const fs::path& folder, const JobManifest& manifest,
                      const std::string& weights_hash, const std::string& engine,
                      const Fingerprint& frozen, const RunOptions& options) {
  const EventIndexes indexes(folder / kEventIndexFile);
  PlannedJob planned = make_plan(manifest, weights_hash, engine,
                                 {.stop = [&] { return options.stop_requested(); },
                                  .trace = options.trace,
                                  .show_phase = options.show_phase,
                                  .limit = limit_of(frozen)});
  indexes.save();
  return planned;
}

/// Each once: a shard may be looked at more than once.
void report_damage(const std::vector<std::string>& faults, RetryReport& report) {
  std::ranges::copy_if(faults, std::back_inserter(report.damaged_shards), [&](const auto& fault) {
    return std::ranges::find(report.damaged_shards, fault) == report.damaged_shards.end();
  });
}

/// The shards with quarantined samples that prove whole; the others are reported. After a request
/// to stop there may be fewer.
std::vector<CommittedShard> trusted_shards(const fs::path& folder, const FrozenPlan& frozen,
                                           const QuarantinedSamples& found,
                                           const RunOptions& options, RetryReport& report) {
  std::vector<const PlannedShard*> shards;
  for (const std::size_t shard : found.shards) shards.push_back(&frozen.plan.shards[shard]);
  EarlierShards earlier =
      check_earlier_shards(folder, frozen, shards,
                           {thread_count(options.threads), [&] { return options.stop_requested(); },
                            options.trace, options.show_phase});
  report_damage(earlier.faults, report);
  if (!options.stop_requested()) {
    report.quarantined = 0;  // what a damaged shard held does not count
    for (const CommittedShard& shard : earlier.done) {
      report.quarantined += std::ssize(shard.record.quarantined);
    }
  }
  // What was made again since the first look may have no quarantined sample any more.
  std::erase_if(earlier.done,
                [](const CommittedShard& shard) { return shard.record.quarantined.empty(); });
  return std::move(earlier.done);
}

/// Gives all sources the class numbers that their committed shards have, and tells which sources
/// have classes that these shards do not name yet.
std::vector<bool> number_as_stored(const fs::path& folder, const FrozenOutline& frozen,
                                   const JobManifest& manifest,
                                   std::vector<std::unique_ptr<Dataset>>& datasets) {
  const auto stored =
      stored_classes(folder, frozen.plan.shards, frozen.hash, manifest.sources.size());
  number_classes(manifest.sources, datasets, stored);
  std::vector<bool> have_new;
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    have_new.push_back(stored[i] && datasets[i]->label_schema().class_names != *stored[i]);
  }
  return have_new;
}

/// Names a source's new classes in all its committed shards, the first of them last: where that has
/// been done (stored_classes), it has been for all. False after a request to stop before that.
bool add_classes(const fs::path& folder, const FrozenPlan& frozen,
                 const std::vector<std::unique_ptr<Dataset>>& datasets,
                 const std::vector<bool>& have_new, const RunOptions& options,
                 RetryReport& report) {
  std::vector<const PlannedShard*> shards;
  for (auto shard = frozen.plan.shards.rbegin(); shard != frozen.plan.shards.rend(); ++shard) {
    if (have_new[static_cast<std::size_t>(shard->source)]) shards.push_back(&*shard);
  }
  if (shards.empty()) return true;
  const EarlierShards earlier =
      check_earlier_shards(folder, frozen, shards,
                           {thread_count(options.threads), [&] { return options.stop_requested(); },
                            options.trace, options.show_phase});
  report_damage(earlier.faults, report);
  if (options.stop_requested()) return false;  // shards may not have been looked at
  for (const CommittedShard& committed : earlier.done) {
    if (options.stop_requested()) return false;
    const auto source = static_cast<std::size_t>(committed.shard->source);
    ShardRewrite rewrite(folder, committed.record, std::nullopt,
                         datasets[source]->label_schema().class_names);
    report.shards_renamed += rewrite.commit();
  }
  return true;
}

/// Puts redone samples into their committed shards; for each shard once it is through, `report`
/// gets tried, mended, failed, shards_rewritten and what is quarantined still.
class RetrySink final : public SampleSink {
 public:
  /// Takes what plan_retry made of `shards`. All must outlive the sink.
  RetrySink(const fs::path& folder, const std::vector<CommittedShard>& shards,
            const std::vector<std::unique_ptr<Dataset>>& datasets, RetryReport& report,
            TraceRecorder* trace)
      : folder_(folder), shards_(shards), datasets_(datasets), report_(report), trace_(trace) {}

  void open(const PlannedShard& shard) override {
    const auto committed = std::ranges::find_if(
        shards_, [&](const CommittedShard& one) { return one.record.shard == shard.name; });
    record_ = &committed->record;
    rewrite_ = std::make_unique<ShardRewrite>(
        folder_, *record_, shard.size_unknown ? std::optional(shard.volume_size) : std::nullopt,
        datasets_[static_cast<std::size_t>(shard.source)]->label_schema().class_names);
  }

  void add(const SampleMessage& message) override {
    const int slot = record_->quarantined.at(static_cast<std::size_t>(message.slot)).slot;
    rewrite_->redo(slot, message);
    if (!message.failed()) return;
    failed_.push_back({record_->shard, slot, message.sample.sample_id, message.sample.fault});
  }

  bool commit() override {
    TraceSpan span(trace_, "commit shard", "shard");
    span.note("shard", record_->shard);
    report_.shards_rewritten += rewrite_->commit();
    mended_ += rewrite_->mended();
    rewrite_.reset();
    const std::int64_t tried = std::ssize(record_->quarantined);
    const std::int64_t mended = tried - std::ssize(failed_);
    report_.tried += tried;
    report_.mended += mended;
    report_.quarantined -= mended;
    report_.failed.insert(report_.failed.end(), failed_.begin(), failed_.end());
    failed_.clear();
    report_.notes = mended_.notes();
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
  const std::vector<CommittedShard>& shards_;
  const std::vector<std::unique_ptr<Dataset>>& datasets_;  // one for each source
  const CommitRecord* record_ = nullptr;                   // of the shard under way
  std::unique_ptr<ShardRewrite> rewrite_;                  // of the shard under way
  std::vector<QuarantinedSlot> failed_;                    // of the shard under way
  InputCounts mended_;
  RetryReport& report_;
  TraceRecorder* trace_;
};

}  // namespace

std::optional<RetryReport> nothing_to_retry(const fs::path& folder, const FrozenOutline& frozen,
                                            const JobManifest& manifest,
                                            const RunOptions& options) {
  require_own_results(folder);
  restore_shards(folder, frozen);
  const QuarantinedSamples found = find_quarantined(folder, frozen);
  if (found.count > 0) return std::nullopt;
  RetryReport report = new_report(folder, found, frozen.plan.sample_count());
  const Fingerprint& before = frozen.plan.fingerprint;
  PlannedJob job = plan_again(folder, manifest, "", "", before, options);
  const auto have_new = number_as_stored(folder, frozen, manifest, job.datasets);
  if (std::ranges::find(have_new, true) != have_new.end()) return std::nullopt;
  Fingerprint& now = job.plan.fingerprint;
  for (auto& [field, value] : now) {
    const auto known = before.find(field);
    const bool is_compared =
        is_amendable(field) || is_addable(field) || field.starts_with("manifest ");
    if (known == before.end() || is_compared) continue;
    value = known->second;  // weights, processor, libraries: for `convert` to compare
  }
  accept_inputs(folder, frozen.hash, before, now, manifest, {}, report);
  return report;
}

RetryReport retry(const fs::path& folder, const JobManifest& manifest, const Generator& generator,
                  const std::string& weights_hash, const RunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  FrozenPlan frozen = read_frozen_plan(folder);
  // Of two that write one shard again, the one that is through last would put back what the other
  // has mended.
  const FileLock lock(folder / "plan.json", FileLock::IfTaken::kGiveUp);
  if (lock.is_taken()) {
    throw std::runtime_error("expected a folder without another retry at work, got one, in " +
                             folder.string() + ": run it again once the other has finished");
  }
  const FrozenOutline outline{outline_of(frozen.plan), frozen.hash};
  require_own_results(folder);
  restore_shards(folder, outline);
  const QuarantinedSamples found = find_quarantined(folder, outline);
  RetryReport report = new_report(folder, found, frozen.plan.sample_count());

  PlannedJob job = plan_again(folder, manifest, weights_hash, generator.description(),
                              frozen.plan.fingerprint, options);
  const auto have_new = number_as_stored(folder, outline, manifest, job.datasets);
  accept_inputs(folder, frozen.hash, frozen.plan.fingerprint, job.plan.fingerprint, manifest,
                found.ids, report);
  job.plan = {};  // the frozen one counts, and it can be huge
  complete_plan(manifest, job.datasets, frozen.plan);
  const bool finalized = fs::exists(folder / "dataset.json");
  const bool all_named = add_classes(folder, frozen, job.datasets, have_new, options, report);

  const std::vector<CommittedShard> shards = trusted_shards(folder, frozen, found, options, report);
  std::vector<PlannedShard> retried = plan_retry(shards);
  std::vector<const PlannedShard*> to_redo;
  for (std::size_t i = 0; i < shards.size(); ++i) {
    to_redo.push_back(&retried[i]);
    // A shard that has good samples already has the size of these.
    if (!retried[i].size_unknown || shards[i].record.valid == 0) continue;
    retried[i].volume_size = ShardReader(folder / retried[i].name).header().volume.size;
  }
  const std::int64_t to_do = report.quarantined;
  RetrySink sink(folder, shards, job.datasets, report, options.trace);
  run_conversion("redo samples",
                 {manifest, job.datasets, generator, weights_hash, folder, frozen, options},
                 to_redo, sink);
  report.stopped = !all_named || (options.stop_requested() && report.tried < to_do);
  report.dataset_outdated = finalized && !fs::exists(folder / "dataset.json");
  report.too_many_faults = beyond_limits(manifest.errors, report.quarantined, report.planned);
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

namespace {

/// What came of the samples that were tried; nothing if the shards were only renamed.
std::string tried_text(const RetryReport& report) {
  if (report.tried > 0 || report.quarantined > 0) {
    return fmt::format("{} of {} fixed, {} rewritten; still quarantined: {} of {}", report.mended,
                       count_text(report.tried, "quarantined sample"),
                       count_text(report.shards_rewritten, "shard"), report.quarantined,
                       count_text(report.planned, "sample"));
  }
  if (report.shards_renamed > 0 || report.stopped) return "";
  return "nothing to retry: no sample of a committed shard is quarantined";
}

Report table_of(const RetryReport& report) {
  constexpr std::ptrdiff_t kListed = 20;
  return {
      {"event", "report"},
      {"damaged_shards", report.damaged_shards,
       listed(report.damaged_shards, "{}; eventgan convert makes it again")},
      {"shards_missing", report.shards_missing,
       count_text(report.shards_missing, "shard") + " not made yet: run eventgan convert"},
      {"changed_inputs", report.changed_inputs,
       fmt::format("inputs changed since the plan was frozen ({}): recorded, eventgan convert will "
                   "accept them; samples that are done keep the old ones, and new images are in no "
                   "plan: for all of them, convert to another --output",
                   fmt::join(report.changed_inputs, ", "))},
      {"shards_renamed", report.shards_renamed,
       "classes were added: named in " + count_text(report.shards_renamed, "shard")},
      tried_text(report),
      {"planned", report.planned},
      {"tried", report.tried},
      {"mended", report.mended},
      {"shards_rewritten", report.shards_rewritten},
      {"quarantined", report.quarantined},
      {"failed", report.failed,
       listed(report.failed, kListed, " (in the shards' commit records)",
              [](const QuarantinedSlot& sample) { return "quarantined: " + sample.reason; })},
      {"dataset_outdated", report.dataset_outdated,
       "dataset.json and dataset.h5 described the shards as they were and are removed: run "
       "eventgan finalize again"},
      {"stopped", report.stopped, "stopped before all were done: run again"},
      {"notes", report.notes, notes_text(report.notes)},
      {"folder", report.folder, report.folder},
      {"too_many_faults", report.too_many_faults},
      {"wall_seconds", report.wall_seconds}};
}

}  // namespace

std::string to_text(const RetryReport& report) { return text_of(table_of(report)); }
std::string to_json(const RetryReport& report) { return json_text_of(table_of(report)); }

}  // namespace eventgan
