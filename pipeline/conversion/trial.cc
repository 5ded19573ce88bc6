#include "pipeline/conversion/trial.h"

#include <map>
#include <numeric>
#include <utility>

#include "pipeline/samples/sample_stages.h"

namespace eventgan {
namespace {

struct Place {
  const PlannedShard* shard = nullptr;
  int slot = 0;
};

/// The first `most` + 1 samples of each source without known faults: a video can only be decoded
/// from its start, and so costs what it will in the run.
std::vector<Place> first_of_each_source(const Plan& plan, int most) {
  std::vector<Place> places;
  std::map<int, int> taken;  // by source
  for (const PlannedShard& shard : plan.shards) {
    for (std::size_t slot = 0; slot < shard.samples.size() && taken[shard.source] <= most; ++slot) {
      if (!shard.samples[slot].fault.empty()) continue;
      places.push_back({&shard, static_cast<int>(slot)});
      ++taken[shard.source];
    }
  }
  return places;
}

/// What some pairs cost together.
struct Cost {
  double seconds = 0;
  double bytes = 0;
  double pixels = 0;
};

SampleMessage run(const SampleStages& stages, const Place& place) {
  SampleMessage message;
  message.shard = place.shard;
  message.slot = place.slot;
  stages.read(message);
  stages.generate(message);
  stages.finish(message);
  return message;
}

}  // namespace

TrialEstimate measure_trial(const JobManifest& manifest, const PlannedJob& job,
                            const Generator& generator, int threads, int most) {
  const SampleStages stages(manifest, job.datasets, generator, 1);
  TrialEstimate estimate;
  std::map<int, Cost> costs;  // by source
  int warm_source = -1;
  for (const Place& place : first_of_each_source(job.plan, most)) {
    const SampleMessage message = run(stages, place);
    // The first pair of a source is not measured: libraries prepare, a video is opened.
    if (std::exchange(warm_source, place.shard->source) != place.shard->source) continue;
    if (message.failed()) continue;
    ++estimate.pairs_measured;
    Cost& cost = costs[place.shard->source];
    cost.seconds += std::accumulate(message.seconds.begin(), message.seconds.end(), 0.0);
    cost.bytes += static_cast<double>(message.chunk.size());
    cost.pixels += static_cast<double>(place.shard->volume_size.pixel_count());
  }
  if (estimate.pairs_measured == 0) return estimate;
  Cost all;
  for (const auto& [source, cost] : costs) {
    all.seconds += cost.seconds;
    all.bytes += cost.bytes;
    all.pixels += cost.pixels;
  }
  double seconds = 0;
  for (const PlannedShard& shard : job.plan.shards) {
    // A source none of whose pairs could be tried costs what the others do.
    const auto found = costs.find(shard.source);
    const Cost& cost = found == costs.end() ? all : found->second;
    const auto pixels = static_cast<double>(shard.volume_size.pixel_count() * shard.samples.size());
    seconds += cost.seconds / cost.pixels * pixels;
    estimate.stored_bytes += cost.bytes / cost.pixels * pixels;
  }
  estimate.seconds_per_pair = seconds / static_cast<double>(job.plan.sample_count());
  estimate.seconds = seconds / threads;
  return estimate;
}

}  // namespace eventgan
