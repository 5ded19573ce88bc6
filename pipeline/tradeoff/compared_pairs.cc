#include "pipeline/tradeoff/compared_pairs.h"

#include <memory>
#include <numeric>
#include <utility>

#include "manifests/values/faults.h"
#include "pipeline/generators/simulated_generator.h"

namespace eventgan {
namespace {

/// Pairs at the start of each source, one after another, on which reading is measured; the first
/// opens files and is not counted.
constexpr std::size_t kPairsToRead = 4;

std::optional<ImageSize> only_size(const Plan& plan) {
  for (const PlannedShard& shard : plan.shards) {
    if (shard.size_unknown || shard.volume_size != plan.shards.front().volume_size) {
      return std::nullopt;
    }
  }
  return plan.shards.empty() ? std::nullopt : std::optional(plan.shards.front().volume_size);
}

/// A shard of one sample alone, as large as the job's volumes are.
PlannedShard shard_of(const PlannedShard& shard, std::size_t slot, const JobManifest& manifest) {
  PlannedShard alone{shard.name, shard.source, manifest.image.size.value_or(shard.volume_size), {}};
  alone.samples.push_back(shard.samples.at(slot));
  return alone;
}

SampleMessage message_of(const PlannedShard& shard) {
  SampleMessage message;
  message.shard = &shard;
  return message;
}

/// Stands in for the generator where pairs are only read: it holds next to no memory.
std::unique_ptr<Generator> reading_generator(const JobManifest& manifest) {
  GeneratorSpec spec;
  spec.kind = GeneratorKind::kDifference;
  return make_simulated_generator(spec, manifest.volume.bins, manifest.seed);
}

/// Processor time to read a pair, mean over the plan.
double measure_reading(const ComparedJob& compared, const JobManifest& job,
                       const SampleStages& stages) {
  double reading_s = 0;  // over the plan
  const Plan& plan = compared.planned.plan;
  for (std::size_t source = 0; source < compared.manifest.sources.size(); ++source) {
    std::vector<double> read_s;
    double planned = 0;
    for (const PlannedShard& shard : plan.shards) {
      if (shard.source != static_cast<int>(source)) continue;
      planned += static_cast<double>(shard.samples.size());
      for (std::size_t slot = 0; slot < shard.samples.size() && read_s.size() <= kPairsToRead;
           ++slot) {
        if (!shard.samples[slot].fault.empty()) continue;
        const PlannedShard alone = shard_of(shard, slot, job);
        SampleMessage message = message_of(alone);
        stages.read(message);
        read_s.push_back(message.seconds[static_cast<std::size_t>(Stage::kRead)]);
      }
    }
    if (read_s.size() > 1) read_s.erase(read_s.begin());
    if (!read_s.empty()) {
      reading_s += planned * std::accumulate(read_s.begin(), read_s.end(), 0.0) /
                   static_cast<double>(read_s.size());
    }
  }
  return reading_s / static_cast<double>(plan.sample_count());
}

}  // namespace

ComparedJob::ComparedJob(const JobManifest& job, int pairs, std::function<bool()> stop)
    : manifest(job),
      planned(make_plan(job, "", "trade-off", {stop})),
      whole(only_size(planned.plan)),
      samples(choose_calibration_samples(planned.plan, pairs, 0)),
      stop_requested(std::move(stop)) {}

TrialJob ComparedJob::as(const Computation& computation, StoredType dtype) const {
  return trial_job(manifest, {computation, dtype}, whole);
}

void ComparedJob::check_stop() const {
  if (stop_requested && stop_requested()) {
    throw Stopped("stopped on request");
  }
}

double SizedPairs::held_bytes() const {
  double bytes = 0;
  for (const SampleMessage& pair : pairs) {
    bytes += static_cast<double>(pair.prepared.input.size() * sizeof(float));
  }
  return bytes;
}

ComparedPairs::ComparedPairs(const ComparedJob& job, const Computation& reference)
    : job_(job), reference_computation_(reference), reference_(read(reference.size)) {}

const SizedPairs& ComparedPairs::of(double size) {
  if (size == reference_.size) return reference_;
  if (size != other_.size) {
    other_ = {};  // first, so that no two are held
    other_ = read(size);
  }
  return other_;
}

SizedPairs ComparedPairs::read(double size) const {
  Computation any = reference_computation_;
  any.size = size;
  const JobManifest job = job_.as(any, job_.manifest.output.dtype).manifest;
  const std::unique_ptr<Generator> reading = reading_generator(job_.manifest);
  const SampleStages stages(job, job_.planned.datasets, *reading, /*in_flight=*/1);
  SizedPairs sized;
  sized.size = size;
  sized.read_s = measure_reading(job_, job, stages);
  for (const CalibrationSample& sample : job_.samples) {
    sized.shards.push_back(shard_of(*sample.shard, static_cast<std::size_t>(sample.slot), job));
  }
  for (const PlannedShard& shard : sized.shards) {
    job_.check_stop();
    SampleMessage& pair = sized.pairs.emplace_back(message_of(shard));
    stages.read(pair);
  }
  return sized;
}

}  // namespace eventgan
