#include "pipeline/conversion/convert.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "manifests/faults.h"
#include "pipeline/conversion/conversion_graph.h"
#include "pipeline/conversion/sample_stages.h"
#include "pipeline/conversion/shard_sink.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/threads/thread_count.h"
#include "stages/files/stale_temporaries.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Memory that samples under way may take together.
constexpr std::size_t kInFlightBytes = std::size_t{1} << 30;
/// A sample's volume stands in memory about this often while it is generated, finished and encoded.
constexpr std::size_t kVolumeCopies = 3;

std::int64_t volume_bytes(const JobManifest& manifest, const PlannedShard& shard) {
  const VolumeShape shape{manifest.volume.bins, shard.volume_size};
  return static_cast<std::int64_t>(shape.value_count() * shard.samples.size() *
                                   stored_size(manifest.output.dtype));
}

ShardHeader make_header(const JobManifest& manifest, const PlannedJob& job,
                        const PlannedShard& shard, const FrozenPlan& frozen,
                        const std::string& weights_hash, const std::string& generator) {
  const auto source = static_cast<std::size_t>(shard.source);
  ShardHeader header;
  header.name = shard.name;
  header.dataset = to_string(manifest.sources[source].dataset);
  header.split = manifest.sources[source].split;
  header.sample_count = static_cast<int>(shard.samples.size());
  header.volume = {manifest.volume.bins, shard.volume_size};
  header.dtype = manifest.output.dtype;
  header.deflate_level = manifest.output.deflate_level;
  header.normalization = manifest.volume.normalize;
  header.unit = manifest.generator.kind == GeneratorKind::kNetwork ? VolumeUnit::kLearned
                                                                   : VolumeUnit::kEvents;
  header.label_schema = job.datasets[source]->label_schema();
  header.preprocessing = preprocessing_json(manifest.image);
  header.plan_hash = frozen.hash;
  header.manifest_text = frozen.plan.manifest_text;
  header.weights_hash = weights_hash;
  header.generator = generator;
  header.program_version = program_version();
  return header;
}

/// The report before anything is made, with what earlier runs have done; `left` gets the shards
/// they have not.
ConversionReport earlier_runs(const fs::path& folder, const JobManifest& manifest,
                              const FrozenPlan& frozen, std::vector<const PlannedShard*>& left) {
  ConversionReport report;
  report.folder = folder.string();
  report.planned = frozen.plan.sample_count();
  report.shards_planned = static_cast<int>(frozen.plan.shards.size());
  for (const SourceSummary& source : frozen.plan.sources) {
    report.without_partner += source.without_partner;
  }
  for (const PlannedShard& shard : frozen.plan.shards) {
    const auto marker = done_marker(folder, shard, frozen.hash);
    if (!marker) {
      left.push_back(&shard);
      continue;
    }
    ++report.shards_done_before;
    report.written += marker->valid;
    report.stored_bytes += marker->size_bytes;
    report.volume_bytes += volume_bytes(manifest, shard);
    report.quarantined.insert(report.quarantined.end(), marker->quarantined.begin(),
                              marker->quarantined.end());
  }
  report.shards_done = report.shards_done_before;
  return report;
}

/// Adds what this run made of `shards`, of which it has committed the first few.
void add_run(ConversionReport& report, const JobManifest& manifest,
             const std::vector<const PlannedShard*>& shards, const ShardSink& sink) {
  report.written += sink.written();
  for (std::size_t i = 0; i < sink.markers().size(); ++i) {
    const ShardMarker& marker = sink.markers()[i];
    ++report.shards_done;
    report.stored_bytes += marker.size_bytes;
    report.volume_bytes += volume_bytes(manifest, *shards[i]);
    for (const auto& [stage, seconds] : marker.stage_seconds)
      report.stage_seconds[stage] += seconds;
  }
  report.quarantined.insert(report.quarantined.end(), sink.quarantined().begin(),
                            sink.quarantined().end());
  report.too_many_faults =
      beyond_limits(manifest.errors, std::ssize(report.quarantined), report.planned);
}

std::int64_t count_samples(const std::vector<const PlannedShard*>& shards) {
  std::int64_t count = 0;
  for (const PlannedShard* shard : shards) count += std::ssize(shard->samples);
  return count;
}

std::size_t largest_sample_bytes(const Plan& plan, int bins) {
  std::size_t largest = 1;
  for (const PlannedShard& shard : plan.shards) {
    const VolumeShape shape{bins, shard.volume_size};
    largest = std::max(largest, kVolumeCopies * shape.value_count() * sizeof(float));
  }
  return largest;
}

}  // namespace

ConversionReport convert(const JobManifest& manifest, const Generator& generator,
                         const std::string& weights_hash, const ConversionOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const fs::path folder = options.output.value_or(resolve(manifest, manifest.output.directory));
  const PlannedJob job = make_plan(manifest, weights_hash, generator.description());
  fs::create_directories(folder);
  remove_stale_temporaries(folder);
  if (options.overwrite) discard_output(folder);
  const FrozenPlan frozen = freeze_plan(folder, job.plan);
  record_manifest_folder(folder, manifest);

  std::vector<const PlannedShard*> shards;
  ConversionReport report = earlier_runs(folder, manifest, frozen, shards);
  ShardSink sink(folder, frozen.hash, manifest.errors, report.planned,
                 std::ssize(report.quarantined), [&](const PlannedShard& shard) {
                   return make_header(manifest, job, shard, frozen, weights_hash,
                                      generator.description());
                 });
  if (sink.stopped()) shards.clear();  // an earlier run has passed the limits

  const int threads = thread_count(options.threads);
  const GraphLimits limits{
      threads, samples_in_flight(threads, largest_sample_bytes(frozen.plan, manifest.volume.bins),
                                 kInFlightBytes)};
  const SampleStages stages(manifest, job.datasets, generator, static_cast<int>(limits.in_flight));
  const std::int64_t to_do = count_samples(shards);
  const std::unique_ptr<Progress> progress =
      options.make_progress && to_do > 0 ? options.make_progress(to_do) : nullptr;
  const std::size_t arrived =
      run_conversion_graph(shards,
                           {[&](SampleMessage& message) { stages.read(message); },
                            [&](SampleMessage& message) { stages.generate(message); },
                            [&](SampleMessage& message) { stages.finish(message); },
                            [&](SampleMessage& message) {
                              sink.accept(message);
                              if (progress)
                                progress->advance(message.failed(), std::ssize(message.chunk));
                              return !sink.stopped();
                            }},
                           limits);
  if (!sink.stopped() && std::cmp_not_equal(arrived, to_do)) {
    throw std::logic_error("expected " + std::to_string(to_do) + " samples at the writer, got " +
                           std::to_string(arrived));
  }
  if (progress) progress->finish();
  add_run(report, manifest, shards, sink);
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace eventgan
