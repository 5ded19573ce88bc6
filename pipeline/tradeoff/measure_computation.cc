#include "pipeline/tradeoff/measure_computation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "pipeline/conversion/conversion_run.h"
#include "pipeline/conversion/pair_volume.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/planning/spread.h"
#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/tradeoff/loss.h"
#include "stages/events/volume_statistics.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"

namespace eventgan {
namespace {

/// In the form in which volumes are compared.
std::vector<float> comparable(std::vector<float> volume, bool is_counts) {
  return is_counts ? normalized(std::move(volume)) : volume;
}

/// Whether it gives events or their rates, and not values that have learnt to be normalised.
bool gives_counts(const GeneratorSpec& spec, const Generator& generator) {
  return !has_weights(spec.kind) || generator.thresholds();
}

/// What a chunk that was just made is read as.
std::vector<float> decoded(std::span<const std::byte> chunk, StoredType type, int deflate_level,
                           float scale, const VolumeShape& shape) {
  std::vector<float> volume(shape.value_count());
  if (!decode_volume(chunk, type, deflate_level, scale, volume)) {
    throw std::logic_error("expected the chunk that was made, got a damaged one");
  }
  return volume;
}

/// A job as one configuration runs it.
struct Runner {
  JobManifest manifest;
  SampleStages stages;
  bool is_counts;

  Runner(JobManifest job, const std::vector<std::unique_ptr<Dataset>>& datasets,
         const Generator& generator)
      : manifest(std::move(job)),
        stages(manifest, datasets, generator, /*in_flight=*/1),
        is_counts(gives_counts(manifest.generator, generator) &&
                  manifest.volume.normalize == Normalization::kNone) {}
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  /// The finished message's volume, [2 bins, y, x] of the whole volume, as it would be read back;
  /// empty if it has failed.
  std::vector<float> volume(SampleMessage message) const {
    const VolumeShape shape{manifest.volume.bins, message.shard->volume_size};
    stages.finish(message);
    if (message.failed()) return {};
    return comparable(decoded(message.chunk, manifest.output.dtype, manifest.output.deflate_level,
                              message.sample.scale, shape),
                      is_counts);
  }
};

}  // namespace

std::vector<std::vector<PairLoss>> measure_losses(ComparedPairs& pairs,
                                                  const Computation& computation,
                                                  std::span<const StoredType> dtypes, int threads,
                                                  const std::function<void()>& each) {
  const ComparedJob& job = pairs.job();
  const Computation& reference_computation = pairs.reference_computation();
  const SizedPairs& reference_pairs = pairs.reference();
  const SizedPairs& sized = pairs.of(computation.size);
  const LoadedGenerator reference =
      load_generator(job.as(reference_computation, StoredType::kFloat32).manifest);
  const LoadedGenerator own = load_generator(job.as(computation, StoredType::kFloat32).manifest);
  const auto runner = [&](const Computation& of, StoredType dtype, const Generator& generator) {
    JobManifest manifest = job.as(of, dtype).manifest;
    manifest.output.deflate_level = 0;  // it loses nothing
    return std::make_unique<Runner>(std::move(manifest), job.planned.datasets, generator);
  };
  const auto reference_runner =
      runner(reference_computation, StoredType::kFloat32, *reference.generator);
  std::vector<std::unique_ptr<Runner>> runners;
  for (const StoredType dtype : dtypes) {
    runners.push_back(runner(computation, dtype, *own.generator));
  }
  std::vector<const PlannedShard*> shards;
  for (const PlannedShard& shard : reference_pairs.shards) shards.push_back(&shard);
  const int at_once =
      graph_limits(shards, *reference.generator, threads, memory_limit_bytes()).generators;

  const std::size_t count = reference_pairs.pairs.size();
  std::vector<std::vector<std::optional<PairLoss>>> by_pair(
      dtypes.size(), std::vector<std::optional<PairLoss>>(count));
  for_each_index(count, at_once, [&](std::size_t pair) {
    job.check_stop();
    SampleMessage wanted = reference_pairs.pairs[pair];
    SampleMessage message = sized.pairs[pair];
    if (wanted.failed() || message.failed()) return;
    const Placement to = wanted.prepared.placement;
    const Placement from = message.prepared.placement;
    const VolumeShape shape{job.manifest.volume.bins, to.volume};
    const std::vector<std::uint8_t> labelled = labelled_pixels(wanted.sample.labels, to.volume);
    reference_runner->stages.generate(wanted);
    const std::vector<float> truth = reference_runner->volume(std::move(wanted));
    runners.front()->stages.generate(message);
    for (std::size_t k = 0; k < dtypes.size() && !truth.empty(); ++k) {
      std::vector<float> volume = runners[k]->volume(message);
      if (volume.empty()) continue;
      volume = on_grid(std::move(volume), shape.channels(), from, to);
      by_pair[k][pair] = pair_loss(volume, truth, shape, labelled);
    }
    each();
  });
  std::vector<std::vector<PairLoss>> losses(dtypes.size());
  for (std::size_t k = 0; k < dtypes.size(); ++k) {
    for (const std::optional<PairLoss>& loss : by_pair[k]) {
      if (loss) losses[k].push_back(*loss);
    }
  }
  return losses;
}

std::vector<RoundCost> take_turn(ComparedPairs& pairs, const Computation& computation,
                                 std::span<const StoredType> dtypes, int threads,
                                 const std::function<void()>& each) {
  const ComparedJob& job = pairs.job();
  const SizedPairs& sized = pairs.of(computation.size);
  const bool peak_is_known = restart_peak_memory();
  const LoadedGenerator loaded = load_generator(job.as(computation, dtypes.front()).manifest);
  std::vector<std::unique_ptr<Runner>> runners;
  for (const StoredType dtype : dtypes) {
    runners.push_back(std::make_unique<Runner>(job.as(computation, dtype).manifest,
                                               job.planned.datasets, *loaded.generator));
  }
  std::vector<const SampleMessage*> read;
  std::vector<const PlannedShard*> shards;
  for (const SampleMessage& pair : sized.pairs) {
    if (pair.failed()) continue;
    read.push_back(&pair);
    shards.push_back(pair.shard);
  }
  // The first pair of each size of images waits for the engine's plan.
  std::set<std::pair<int, int>> warm;
  for (const SampleMessage* pair : read) {
    const ImageSize content = pair->prepared.content;
    if (!warm.insert({content.height, content.width}).second) continue;
    SampleMessage message = *pair;
    runners.front()->stages.generate(message);
  }

  const auto seconds = [](const SampleMessage& message, Stage stage) {
    return message.seconds[static_cast<std::size_t>(stage)];
  };
  std::vector<RoundCost> costs(dtypes.size());
  std::mutex adding;
  double generate_s = 0;
  std::vector<double> finish_s(dtypes.size());
  std::size_t handed_out = 0;
  const auto start = std::chrono::steady_clock::now();
  run_conversion_graph(
      [&] { return handed_out < shards.size() ? shards[handed_out++] : nullptr; },
      {[&](SampleMessage& message) {
         const std::size_t number = message.number;
         message = *read[number];
         message.number = number;
       },
       [&](SampleMessage& message) { runners.front()->stages.generate(message); },
       [&](SampleMessage& message) {
         const double generated_s = seconds(message, Stage::kGenerate);
         for (std::size_t k = 0; k < runners.size(); ++k) {
           // The last takes the volume itself, so that one type alone needs no more than convert.
           // NOLINTNEXTLINE(bugprone-use-after-move): moved in the last round
           SampleMessage part = k + 1 < runners.size() ? message : std::move(message);
           runners[k]->stages.finish(part);
           const std::lock_guard lock(adding);
           finish_s[k] += seconds(part, Stage::kFinish);
           costs[k].stored_bytes += static_cast<double>(part.chunk.size());
         }
         const std::lock_guard lock(adding);
         generate_s += generated_s;
       },
       [&](SampleMessage&) {
         each();
         return true;
       }},
      graph_limits(shards, *loaded.generator, threads, memory_limit_bytes()),
      [&] {
        return job.stop_requested && job.stop_requested() ? StopOrder::kAbort : StopOrder::kGoOn;
      });
  job.check_stop();
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double peak_bytes = peak_is_known ? static_cast<double>(peak_memory_bytes()) : 0;
  const auto count = static_cast<double>(read.size());
  const double busy_cores = std::accumulate(finish_s.begin(), finish_s.end(), generate_s) / wall_s;
  for (std::size_t k = 0; k < costs.size(); ++k) {
    RoundCost& cost = costs[k];
    cost.generator_s = generate_s / count;
    cost.conversion_s = sized.read_s + (generate_s + finish_s[k]) / count;
    cost.pairs_per_s = busy_cores / cost.conversion_s;
    cost.peak_bytes = std::max(peak_bytes - pairs.held_bytes(), 0.0);
    cost.stored_bytes /= count;
  }
  return costs;
}

RealPart part_of(const Recording& recording, int most) {
  RealPart part{recording, {}};
  const std::vector<FrameInterval> all = choose_intervals(recording, 0, std::nullopt, {1});
  for (const std::size_t place : spread(static_cast<std::size_t>(most), all.size())) {
    part.intervals.push_back(all[place]);
  }
  return part;
}

namespace {

/// A frame at another size of its sides.
GreyImage resized(const GreyImage& image, ImageSize size) {
  if (image.size == size) return image;
  std::vector<std::uint8_t> bgr;
  for (const std::uint8_t value : image.pixels) bgr.insert(bgr.end(), 3, value);
  ImageSpec spec;
  spec.size = size;
  return {size, prepare_frame({image.size, bgr.data()}, spec).grey};
}

}  // namespace

std::vector<RealismScores> real_scores(const RealPart& part, const JobManifest& job, double size,
                                       std::span<const StoredType> dtypes, int threads,
                                       const std::function<void()>& each) {
  const LoadedGenerator loaded = load_generator(job);
  const ImageSize whole = part.recording.size();
  ImageSpec smaller;
  smaller.size = {static_cast<int>(std::lround(whole.height * size)),
                  static_cast<int>(std::lround(whole.width * size))};
  const Placement from = place(whole, smaller);
  const Placement to = place(whole, {});
  const VolumeShape shape{job.volume.bins, whole};
  const VolumeShape own_shape{job.volume.bins, *smaller.size};
  std::vector<std::vector<RealismScores>> scores(dtypes.size(),
                                                 std::vector<RealismScores>(part.intervals.size()));
  for_each_index(part.intervals.size(), threads, [&](std::size_t i) {
    const RealInterval real = read_interval(part.recording, part.intervals[i], shape.bins);
    IntervalFrames frames = real.frames;
    frames.previous = resized(frames.previous, own_shape.size);
    frames.next = resized(frames.next, own_shape.size);
    std::vector<float> generated(own_shape.value_count());
    const PreparedPair pair{network_input(frames), own_shape.size, 0, 0, place(own_shape.size, {})};
    const std::string id = std::to_string(i), name = part.recording.name();
    const PairKey key{job.seed, name, id};
    // a recording has no labels
    generate_volume(*loaded.generator, job.generator, key, pair, {}, generated);
    add_pair_noise(job.generator, key, frames.duration_s, own_shape, generated);
    for (std::size_t k = 0; k < dtypes.size(); ++k) {
      const EncodedVolume stored = VolumeCodec(dtypes[k], 0).encode(generated);
      std::vector<float> volume = decoded(stored.chunk, dtypes[k], 0, stored.scale, own_shape);
      volume = comparable(std::move(volume), gives_counts(job.generator, *loaded.generator));
      volume = on_grid(std::move(volume), shape.channels(), from, to);
      scores[k][i] =
          realism_scores(volume, real.volume, shape, real.frames.previous, real.frames.next);
    }
    each();
  });
  std::vector<RealismScores> means;
  for (const std::vector<RealismScores>& of_dtype : scores) means.push_back(mean_scores(of_dtype));
  return means;
}

}  // namespace eventgan
