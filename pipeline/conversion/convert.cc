#include "pipeline/conversion/convert.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <map>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/conversion/shard_sink.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_backup.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/runtime/trace.h"
#include "stages/frames/sources/class_numbers.h"
#include "stages/recordings/order/event_index.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

void tell(const std::function<void(const std::string&)>& listener, const std::string& text) {
  if (listener) listener(text);
}

std::int64_t volume_bytes(const JobManifest& manifest, const PlannedShard& shard) {
  const VolumeShape shape{manifest.volume.bins, shard.volume_size};
  return static_cast<std::int64_t>(shape.value_count() * shard.samples.size() *
                                   stored_size(manifest.output.dtype));
}

/// A folder in which all is well is not touched.
void record_place(const fs::path& folder, const JobManifest& manifest,
                  const ConversionOptions& options) {
  if (recorded_manifest_folder(folder) == manifest.directory) return;
  const fs::path record = folder / "run.json";
  if (fs::exists(record)) {
    tell(options.note, record.string() + ": the manifest is now in " + manifest.directory.string());
  }
  record_manifest_folder(folder, manifest);
}

/// Before anything is written: this worker's part of the folder holds no file of a person's under a
/// name that it needs.
void require_own_files(const fs::path& folder, const Plan& plan, const WorkerPart& part) {
  require_own_results(folder);
  for (std::size_t i = 0; i < plan.shards.size(); ++i) {
    if (part.has(static_cast<int>(i))) require_own_shard(folder, plan.shards[i].name);
  }
}

/// Makes the folder ready and freezes the plan in it, or takes the one that is there.
FrozenPlan prepare_folder(const fs::path& folder, const JobManifest& manifest, Plan plan,
                          const ConversionOptions& options) {
  const TraceSpan span(options.trace, "freeze plan", "job");
  if (options.overwrite && options.part.count != 1) {
    throw UsageError("expected --overwrite without --shards, got " + options.part.origin +
                     ": every worker would discard the others' shards");
  }
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw std::runtime_error("cannot create " + folder.string() + ": " + error.message());
  }
  if (options.overwrite) discard_output(folder, plan.fingerprint, manifest.directory);
  FrozenPlan frozen = freeze_plan(folder, std::move(plan), options.show_phase, manifest.directory);
  restore_shards(folder, {outline_of(frozen.plan), frozen.hash});
  record_place(folder, manifest, options);
  return frozen;
}

using PlannedShards = std::vector<const PlannedShard*>;  // of the frozen plan, in its order

/// Of a run that has not begun.
ConversionReport empty_report(const fs::path& folder, const Plan& plan, const PlannedShards& own,
                              const WorkerPart& part) {
  ConversionReport report;
  report.folder = folder.string();
  report.plan_pairs = plan.sample_count();
  report.plan_shards = static_cast<int>(plan.shards.size());
  report.part = to_text(part, report.plan_shards);
  report.shards_planned = static_cast<int>(own.size());
  for (const PlannedShard* shard : own) report.planned += std::ssize(shard->samples);
  for (const SourceSummary& source : plan.sources) {
    report.unpaired += source.unpaired;
    report.unpaired_frames += static_cast<std::int64_t>(source.unpaired_ids.size());
  }
  return report;
}

void say_part(const ConversionReport& report, const ConversionOptions& options) {
  if (report.shards_planned == report.plan_shards) return;
  const std::string plan = " of the plan's " + count_text(report.plan_shards, "shard");
  tell(options.note, report.shards_planned == 0
                         ? report.part + ": nothing to do, it has none" + plan
                         : report.part + ": " + std::to_string(report.shards_planned) + plan +
                               ", " + count_text(report.planned, "pair"));
}

/// Checks what earlier runs left, and reports it.
EarlierShards look_back(const ConversionJob& job, const ConversionOptions& options,
                        const PlannedShards& own, const PlannedShards& elsewhere,
                        ConversionReport& report) {
  const TraceSpan span(options.trace, "check earlier shards", "job");
  const ScanOptions scan{thread_count(options.threads), [&] { return options.stop_requested(); },
                         options.trace, options.show_phase};
  EarlierShards earlier = check_earlier_shards(job.folder, job.frozen, own, scan);
  for (const std::string& fault : earlier.faults) {
    tell(options.warn, fault + "; making it again");
  }
  report.damaged = earlier.faults;
  for (const CommittedShard& done : earlier.done) {
    add_shard(done.record, volume_bytes(job.manifest, *done.shard), report);
  }
  report.shards_done_before = report.shards_done;
  // Where not even a plan of quarantined samples passes the limits, nobody needs to count.
  if (beyond_limits(job.manifest.errors, report.plan_pairs, report.plan_pairs)) {
    report.quarantined_elsewhere = count_quarantined(job.folder, job.frozen, elsewhere, scan);
  }
  return earlier;
}

/// Reports what was made since look_back found `earlier`, and the notes on the inputs of all these.
void add_made(const ConversionJob& job, const std::vector<CommittedShard>& earlier,
              const std::vector<CommittedShard>& by_this_run, const PlannedShards& by_others,
              ConversionReport& report) {
  std::map<const PlannedShard*, InputCounts> counts;  // in the plan's order, whoever made them
  for (const CommittedShard& done : earlier) counts[done.shard] = done.record.inputs;
  for (const CommittedShard& made : by_this_run) {
    counts[made.shard] = made.record.inputs;
    add_shard(made.record, volume_bytes(job.manifest, *made.shard), report);
    for (const auto& [stage, seconds] : made.record.stage_seconds) {
      report.stage_seconds[stage] += seconds;
    }
  }
  for (const PlannedShard* shard : by_others) {
    const ShardState state = shard_state(job.folder, outline_of(*shard), job.frozen.hash);
    if (!state.done()) continue;  // the last look tells of it
    ++report.shards_done_by_others;
    counts[shard] = state.record->inputs;
    add_shard(*state.record, volume_bytes(job.manifest, *shard), report);
  }
  InputCounts inputs;
  for (const auto& [shard, of_shard] : counts) inputs += of_shard;
  std::ranges::copy(inputs.notes(), std::back_inserter(report.notes));
}

/// A last look at the part, so that "complete" is what is in the folder: beside this run
/// another may have overwritten, or a person deleted, what was committed.
void look_again(const ConversionJob& job, const ConversionOptions& options,
                const PlannedShards& own, ConversionReport& report) {
  const TraceSpan span(options.trace, "look again at all shards", "job");
  for (const ShardState& shard :
       scan_shards(job.folder, outlines_of(own), job.frozen.hash, ScanDepth::kRecord,
                   {.threads = thread_count(options.threads), .show_phase = options.show_phase})) {
    if (shard.done()) continue;
    report.lost.push_back((job.folder / shard.outline.name).string() +
                          ": expected the committed shard, got " + to_string(shard.condition));
    tell(options.warn, report.lost.back() + "; run again");
  }
}

}  // namespace

ConversionReport convert(const JobManifest& manifest, const Generator& generator,
                         const std::string& weights_hash, const ConversionOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const fs::path folder = options.output.value_or(resolve(manifest, manifest.output.directory));
  std::optional<EventIndexes> indexes(std::in_place, folder / kEventIndexFile);
  PlannedJob planned = make_plan(manifest, weights_hash, generator.description(),
                                 {.stop = [&] { return options.stop_requested(); },
                                  .trace = options.trace,
                                  .show_phase = options.show_phase,
                                  .limit = options.limit});
  require_own_files(folder, planned.plan, options.part);
  if (options.on_planned) options.on_planned();
  for (const std::string& warning : planned.warnings) tell(options.warn, warning);
  std::vector<std::string> notes = notes_of(planned.plan.sources);  // as the inputs are today
  const auto fingerprint = planned.plan.fingerprint;
  FrozenPlan frozen = prepare_folder(folder, manifest, std::move(planned.plan), options);
  indexes->save();
  indexes.reset();  // no recording is opened for the first time from here on
  if (frozen.plan.fingerprint != fingerprint) {  // inputs were mended since
    complete_plan(manifest, planned.datasets, frozen.plan);
  }
  if (!read_amendments(folder, frozen.hash).empty()) {  // a retry may have added classes
    number_classes(manifest.sources, planned.datasets,
                   stored_classes(folder, outline_of(frozen.plan).shards, frozen.hash,
                                  manifest.sources.size()));
  }
  const ConversionJob job{manifest, planned.datasets, generator, weights_hash,
                          folder,   frozen,           options};

  PlannedShards own;  // this worker's
  PlannedShards elsewhere;
  for (std::size_t i = 0; i < frozen.plan.shards.size(); ++i) {
    const bool is_own = options.part.has(static_cast<int>(i));
    (is_own ? own : elsewhere).push_back(&frozen.plan.shards[i]);
  }
  ConversionReport report = empty_report(folder, frozen.plan, own, options.part);
  report.is_labelled = false;
  for (std::size_t i = 0; i < manifest.sources.size(); ++i) {
    const LabelSchema& names = planned.datasets[i]->label_schema();
    report.has_flow |= manifest.sources[i].flow;
    const bool has_names = !names.class_names.empty() || !names.joint_names.empty();
    report.is_labelled |=
        has_events(manifest.sources[i].dataset) ? has_names : has_labels(manifest.sources[i]);
  }
  report.notes = std::move(notes);
  say_part(report, options);
  EarlierShards earlier = look_back(job, options, own, elsewhere, report);
  SharedFolder shared(folder, frozen.hash, std::move(earlier.distrusted));
  ShardSink sink(job, shared, report.quarantined_in_plan());
  const PlannedShards by_others = run_conversion("make shards", job, earlier.left, sink, &shared);
  add_made(job, earlier.done, sink.committed(), by_others, report);
  report.too_many_faults =
      beyond_limits(manifest.errors, report.quarantined_in_plan(), report.plan_pairs);
  report.stopped = options.stop_requested() && !report.complete();
  if (!report.stopped && !report.too_many_faults) look_again(job, options, own, report);
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace eventgan
