#include "pipeline/tradeoff/tradeoff.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <mutex>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "pipeline/conversion/conversion_run.h"
#include "pipeline/conversion/plan_summary.h"
#include "pipeline/conversion/sample_stages.h"
#include "pipeline/generators/calibrate.h"
#include "pipeline/generators/choose_engine.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/generators/simulated_generator.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/tradeoff/kept_trials.h"
#include "pipeline/tradeoff/real_scores.h"
#include "stages/base/files/sha256.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/shipped_weights.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"

namespace eventgan {

TradeoffAxes default_axes(const JobManifest& manifest) {
  TradeoffAxes axes;
  const GeneratorSpec& generator = manifest.generator;
  axes.methods = {GeneratorKind::kNetwork};
  if (generator.kind != GeneratorKind::kNetwork) axes.methods.push_back(generator.kind);
  for (const int width : shipped_widths()) {
    axes.weights.push_back("shipped:" + std::to_string(width));
  }
  const std::string own = shipped_weights_name(generator.weights);
  if (generator.kind == GeneratorKind::kNetwork &&
      std::ranges::find(axes.weights, own) == axes.weights.end()) {
    axes.weights.push_back(own);
  }
  axes.precisions = {Precision::kFloat32, Precision::kBfloat16, Precision::kInt8};
  axes.sizes = {1};
  axes.scopes = {generator.scope.scope};
  axes.dtypes = {manifest.output.dtype};
  return axes;
}

namespace {

/// Pairs at the start of each source, one after another, on which reading is measured; the first
/// opens files and is not counted.
constexpr std::size_t kPairsToRead = 4;

/// The volumes' size where the manifest does not say it; none if there are several, or it is not
/// known.
std::optional<ImageSize> only_size(const Plan& plan) {
  for (const PlannedShard& shard : plan.shards) {
    if (shard.size_unknown || shard.volume_size != plan.shards.front().volume_size) {
      return std::nullopt;
    }
  }
  return plan.shards.empty() ? std::nullopt : std::optional(plan.shards.front().volume_size);
}

/// "Intel(R) Xeon(R) Processor, avx512_core_vnni".
std::string processor_text() {
  std::string name = "unknown processor";
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("model name")) continue;
    name = line.substr(line.find(':') + 2);
    break;
  }
  return name + ", " + engine_support(Precision::kFloat32).processor;
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

double seconds(const SampleMessage& message, Stage stage) {
  return message.seconds[static_cast<std::size_t>(stage)];
}

/// The job's pairs as the generator gets them, in one size.
struct SizedPairs {
  double size = 0;
  std::vector<PlannedShard> shards;  ///< one for each chosen pair
  std::vector<SampleMessage> pairs;  ///< read; some have failed
  double read_s = 0;                 ///< processor time to read a pair in a conversion

  double held_bytes() const {
    double bytes = 0;
    for (const SampleMessage& pair : pairs) {
      bytes += static_cast<double>(pair.prepared.input.size() * sizeof(float));
    }
    return bytes;
  }
};

/// In the form in which volumes are compared.
std::vector<float> comparable(std::vector<float> volume, bool is_counts) {
  return is_counts ? normalized(std::move(volume)) : volume;
}

/// A job as one configuration runs it.
struct Runner {
  JobManifest manifest;
  SampleStages stages;

  Runner(JobManifest job, const std::vector<std::unique_ptr<Dataset>>& datasets,
         const Generator& generator)
      : manifest(std::move(job)), stages(manifest, datasets, generator, /*in_flight=*/1) {}
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  /// The finished message's volume, [2 bins, y, x] of the whole volume, as it would be read back;
  /// empty if it has failed.
  std::vector<float> volume(SampleMessage message) const {
    const VolumeShape shape{manifest.volume.bins, message.shard->volume_size};
    stages.finish(message);
    if (message.failed()) return {};
    const StoredType type = manifest.output.dtype;
    const auto bytes = decode_chunk(message.chunk, type, manifest.output.deflate_level,
                                    shape.value_count() * stored_size(type));
    return comparable(dequantize(bytes.value(), type, message.sample.scale),
                      manifest.generator.kind != GeneratorKind::kNetwork &&
                          manifest.volume.normalize == Normalization::kNone);
  }
};

/// Stands in for the generator where pairs are only read: it holds next to no memory.
std::unique_ptr<Generator> reading_generator(const JobManifest& manifest) {
  GeneratorSpec spec;
  spec.kind = GeneratorKind::kDifference;
  return make_simulated_generator(spec, manifest.volume.bins, manifest.seed);
}

class Comparison {
 public:
  Comparison(const JobManifest& manifest, const TradeoffOptions& options)
      : manifest_(manifest),
        options_(options),
        threads_(thread_count(options.threads)),
        job_(make_plan(manifest, "", "trade-off", {options.stop_requested})),
        whole_(only_size(job_.plan)),
        samples_(choose_calibration_samples(job_.plan, options.pairs, 0)),
        reading_(reading_generator(manifest)) {}

  TradeoffReport run();

 private:
  /// What runs a computation, found out once; a reason if nothing can.
  struct Able {
    std::string description;  ///< of weights and engine, all that decides its volumes
    int base_channels = 0;
    std::string reason;
  };

  JobManifest job_of(const Computation& computation, StoredType dtype) const {
    return trial_job(manifest_, {computation, dtype}, whole_).manifest;
  }
  Able look_at(const Computation& computation) const;
  Computation choose_reference() const;
  void choose_trials();
  void check_stop() const {
    if (options_.stop_requested && options_.stop_requested()) {
      throw Stopped("asked to stop; what is measured is kept, and the same command goes on");
    }
  }

  SizedPairs read_pairs(double size) const;
  const SizedPairs& pairs_of(double size);
  /// Trials, by index, of one computation.
  using Group = std::vector<std::size_t>;
  /// Those that still lack something.
  template <class Lacks>
  std::vector<Group> groups(Lacks lacks) const;
  /// What is not measured yet.
  struct Work {
    std::vector<Group> losses;
    std::vector<std::vector<Group>> rounds;  ///< by round; some are empty
    std::vector<std::vector<Group>> real;    ///< by recording
  };
  Work work_left() const;
  double pair_s(const Computation& computation) const;
  double scoring_s() const;
  void announce(const Work& work);

  void find_losses(const Group& group);
  std::vector<RoundCost> take_turn(const Computation& computation,
                                   const std::vector<StoredType>& dtypes);
  void run_round(std::size_t round, const std::vector<Group>& lacking);
  void find_real(const Group& group, const RealPart& part);
  void advance() {
    const std::lock_guard lock(telling_);
    if (progress_) progress_->advance(false, 0);
  }

  const JobManifest& manifest_;
  const TradeoffOptions& options_;
  int threads_;
  PlannedJob job_;
  std::optional<ImageSize> whole_;
  std::vector<CalibrationSample> samples_;
  std::unique_ptr<Generator> reading_;
  TradeoffReport report_;
  SizedPairs reference_pairs_;
  SizedPairs other_pairs_;  ///< of the size at work, if that is another
  std::vector<RealPart> real_;
  std::unique_ptr<KeptTrials> kept_;
  std::unique_ptr<Progress> progress_;
  std::mutex telling_;
};

Comparison::Able Comparison::look_at(const Computation& computation) const {
  Able able;
  JobManifest job;
  try {
    job = job_of(computation, manifest_.output.dtype);
  } catch (const UsageError& error) {
    able.reason = error.what();
    return able;
  }
  if (computation.method == GeneratorKind::kNetwork) {
    able.base_channels = load_weights(job).weights.base_channels;  // throws: a slip of the user's
    const EngineSupport support = engine_support(computation.precision);
    if (options_.only_native && computation.precision != Precision::kFloat32 && !support.native) {
      able.reason = fmt::format("this processor ({}) has no instructions for {}", support.processor,
                                to_string(computation.precision));
      return able;
    }
  }
  try {
    const LoadedGenerator loaded = load_generator(job);
    able.description = loaded.weights_hash + " " + loaded.generator->description();
  } catch (const UsageError& error) {
    able.reason = error.what();
  } catch (const InputError& error) {  // the engine refuses the weights
    able.reason = error.what();
  }
  return able;
}

Computation Comparison::choose_reference() const {
  if (options_.reference) return *options_.reference;
  Computation widest;
  int channels = 0;
  for (const std::string& weights : options_.axes.weights) {
    const Computation candidate{GeneratorKind::kNetwork, weights, Precision::kFloat32, 1};
    const int base_channels = look_at(candidate).base_channels;
    if (base_channels > channels) widest = candidate;
    channels = std::max(channels, base_channels);
  }
  if (channels == 0) throw UsageError("--widths: expected weights to compare with, got none");
  return widest;
}

void Comparison::choose_trials() {
  const Able reference = look_at(report_.reference);
  if (!reference.reason.empty()) {
    throw UsageError("--reference: expected a configuration that can be run, got " +
                     name_of(report_.reference) + ": " + reference.reason);
  }
  std::string common =
      fmt::format("{}\n{}\n{} threads\n{} pairs\nagainst {} {}\n", processor_text(), kKeptVersion,
                  threads_, options_.pairs, name_of(report_.reference), reference.description);
  for (const auto& [field, value] : job_.plan.fingerprint) common += field + "=" + value + "\n";
  // The fingerprint has frames by name and size.
  for (const SampleMessage& pair : reference_pairs_.pairs) {
    common += sha256_hex(std::as_bytes(std::span(pair.prepared.input))) + "\n";
  }
  for (const Computation& computation : computations(options_.axes)) {
    const Able able = look_at(computation);
    if (!able.reason.empty()) {
      report_.refused.push_back({computation, able.reason});
      continue;
    }
    for (const StoredType dtype : options_.axes.dtypes) {
      Trial trial;
      trial.configuration = {computation, dtype};
      trial.lines = trial_job(manifest_, trial.configuration, whole_).lines;
      kept_->load(trial, sha256_hex(common + name_of(trial.configuration) + able.description));
      report_.trials.push_back(std::move(trial));
    }
  }
  if (report_.trials.empty()) {
    throw UsageError(
        "expected a configuration that can be run, got none: " +
        (report_.refused.empty() ? "the axes are empty" : report_.refused.front().reason));
  }
}

SizedPairs Comparison::read_pairs(double size) const {
  Computation any = report_.reference;
  any.size = size;
  const JobManifest job = job_of(any, manifest_.output.dtype);
  const SampleStages stages(job, job_.datasets, *reading_, /*in_flight=*/1);
  SizedPairs sized;
  sized.size = size;

  double reading_s = 0;  // over the plan
  for (std::size_t source = 0; source < manifest_.sources.size(); ++source) {
    std::vector<double> read_s;
    double planned = 0;
    for (const PlannedShard& shard : job_.plan.shards) {
      if (shard.source != static_cast<int>(source)) continue;
      planned += static_cast<double>(shard.samples.size());
      for (std::size_t slot = 0; slot < shard.samples.size() && read_s.size() <= kPairsToRead;
           ++slot) {
        if (!shard.samples[slot].fault.empty()) continue;
        const PlannedShard alone = shard_of(shard, slot, job);
        SampleMessage message = message_of(alone);
        stages.read(message);
        read_s.push_back(seconds(message, Stage::kRead));
      }
    }
    if (read_s.size() > 1) read_s.erase(read_s.begin());
    if (!read_s.empty()) {
      reading_s += planned * std::accumulate(read_s.begin(), read_s.end(), 0.0) /
                   static_cast<double>(read_s.size());
    }
  }
  sized.read_s = reading_s / static_cast<double>(job_.plan.sample_count());

  for (const CalibrationSample& sample : samples_) {
    sized.shards.push_back(shard_of(*sample.shard, static_cast<std::size_t>(sample.slot), job));
  }
  for (const PlannedShard& shard : sized.shards) {
    check_stop();
    SampleMessage& pair = sized.pairs.emplace_back(message_of(shard));
    stages.read(pair);
  }
  return sized;
}

const SizedPairs& Comparison::pairs_of(double size) {
  if (size == reference_pairs_.size) return reference_pairs_;
  if (size != other_pairs_.size) {
    other_pairs_ = {};  // first, so that no two are held
    other_pairs_ = read_pairs(size);
  }
  return other_pairs_;
}

template <class Lacks>
std::vector<Comparison::Group> Comparison::groups(Lacks lacks) const {
  std::vector<Group> all;
  const auto computation = [&](std::size_t i) -> const Computation& {
    return report_.trials[i].configuration.computation;
  };
  for (std::size_t i = 0; i < report_.trials.size(); ++i) {
    if (!lacks(report_.trials[i])) continue;
    if (all.empty() || computation(all.back().front()) != computation(i)) all.emplace_back();
    all.back().push_back(i);
  }
  // Sizes together, so that the pairs of each are read once.
  std::ranges::stable_sort(all, std::ranges::greater(),
                           [&](const Group& group) { return computation(group.front()).size; });
  return all;
}

/// Loss of the trials of one computation, pairs in parallel.
void Comparison::find_losses(const Group& group) {
  const Computation& computation = report_.trials[group.front()].configuration.computation;
  const SizedPairs& sized = pairs_of(computation.size);
  const LoadedGenerator reference = load_generator(job_of(report_.reference, StoredType::kFloat32));
  const LoadedGenerator own = load_generator(job_of(computation, StoredType::kFloat32));
  const auto runner = [&](const Computation& of, StoredType dtype, const Generator& generator) {
    JobManifest job = job_of(of, dtype);
    job.output.deflate_level = 0;  // it loses nothing
    return std::make_unique<Runner>(std::move(job), job_.datasets, generator);
  };
  const auto reference_runner =
      runner(report_.reference, StoredType::kFloat32, *reference.generator);
  std::vector<std::unique_ptr<Runner>> runners;
  std::vector<const PlannedShard*> shards;
  for (const std::size_t i : group) {
    runners.push_back(runner(computation, report_.trials[i].configuration.dtype, *own.generator));
  }
  for (const PlannedShard& shard : reference_pairs_.shards) shards.push_back(&shard);
  const int at_once =
      graph_limits(shards, *reference.generator, threads_, memory_limit_bytes()).generators;

  const std::size_t pairs = samples_.size();
  std::vector<std::vector<std::optional<PairLoss>>> losses(
      group.size(), std::vector<std::optional<PairLoss>>(pairs));
  for_each_index(pairs, at_once, [&](std::size_t pair) {
    check_stop();
    SampleMessage wanted = reference_pairs_.pairs[pair];
    SampleMessage message = sized.pairs[pair];
    if (wanted.failed() || message.failed()) return;
    const Placement to = wanted.prepared.placement;
    const Placement from = message.prepared.placement;
    const VolumeShape shape{manifest_.volume.bins, to.volume};
    const std::vector<std::uint8_t> labelled = labelled_pixels(wanted.sample.labels, to.volume);
    reference_runner->stages.generate(wanted);
    const std::vector<float> truth = reference_runner->volume(std::move(wanted));
    runners.front()->stages.generate(message);
    for (std::size_t k = 0; k < group.size() && !truth.empty(); ++k) {
      std::vector<float> volume = runners[k]->volume(message);
      if (volume.empty()) continue;
      volume = on_grid(std::move(volume), shape.channels(), from, to);
      losses[k][pair] = pair_loss(volume, truth, shape, labelled);
    }
    advance();
  });
  for (std::size_t k = 0; k < group.size(); ++k) {
    Trial& trial = report_.trials[group[k]];
    trial.quarantined = report_.pairs;
    for (const std::optional<PairLoss>& loss : losses[k]) {
      if (!loss) continue;
      trial.losses.push_back(*loss);
      --trial.quarantined;
    }
    kept_->save(trial);
  }
}

/// All pairs through generate and finish on all threads, one turn for all stored types.
std::vector<RoundCost> Comparison::take_turn(const Computation& computation,
                                             const std::vector<StoredType>& dtypes) {
  const SizedPairs& sized = pairs_of(computation.size);
  const bool peak_is_known = restart_peak_memory();
  const LoadedGenerator loaded = load_generator(job_of(computation, dtypes.front()));
  std::vector<std::unique_ptr<Runner>> runners;
  for (const StoredType dtype : dtypes) {
    runners.push_back(
        std::make_unique<Runner>(job_of(computation, dtype), job_.datasets, *loaded.generator));
  }
  std::vector<const SampleMessage*> pairs;
  std::vector<const PlannedShard*> shards;
  for (const SampleMessage& pair : sized.pairs) {
    if (pair.failed()) continue;
    pairs.push_back(&pair);
    shards.push_back(pair.shard);
  }
  // The first pair of each size of pictures waits for the engine's plan.
  std::set<std::pair<int, int>> warm;
  for (const SampleMessage* pair : pairs) {
    const ImageSize content = pair->prepared.content;
    if (!warm.insert({content.height, content.width}).second) continue;
    SampleMessage message = *pair;
    runners.front()->stages.generate(message);
  }

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
         message = *pairs[number];
         message.number = number;
       },
       [&](SampleMessage& message) { runners.front()->stages.generate(message); },
       [&](SampleMessage& message) {
         const double generated_s = seconds(message, Stage::kGenerate);
         for (std::size_t k = 0; k < runners.size(); ++k) {
           // The last takes the volume itself, so that one type alone needs no more than convert.
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
         advance();
         return true;
       }},
      graph_limits(shards, *loaded.generator, threads_, memory_limit_bytes()),
      [&] {
        return options_.stop_requested && options_.stop_requested() ? StopOrder::kAbort
                                                                    : StopOrder::kGoOn;
      });
  check_stop();
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double peak_bytes = peak_is_known ? static_cast<double>(peak_memory_bytes()) : 0;
  const auto count = static_cast<double>(pairs.size());
  const double busy_cores = std::accumulate(finish_s.begin(), finish_s.end(), generate_s) / wall_s;
  for (std::size_t k = 0; k < costs.size(); ++k) {
    RoundCost& cost = costs[k];
    cost.generator_s = generate_s / count;
    cost.conversion_s = sized.read_s + (generate_s + finish_s[k]) / count;
    cost.pairs_per_s = busy_cores / cost.conversion_s;
    cost.peak_bytes =
        std::max(peak_bytes - reference_pairs_.held_bytes() - other_pairs_.held_bytes(), 0.0);
    cost.stored_bytes /= count;
  }
  return costs;
}

/// The reference first, with every stored type as the others have them: that costs a turn the same.
void Comparison::run_round(std::size_t round, const std::vector<Group>& lacking) {
  std::vector<StoredType> types = options_.axes.dtypes;
  if (std::ranges::find(types, manifest_.output.dtype) == types.end()) {
    types.push_back(manifest_.output.dtype);
  }
  const auto cost_of = [&](const std::vector<RoundCost>& costs, StoredType type) {
    return costs.at(static_cast<std::size_t>(std::ranges::find(types, type) - types.begin()));
  };
  const std::vector<RoundCost> reference = take_turn(report_.reference, types);
  for (const Group& group : lacking) {
    const Computation& computation = report_.trials[group.front()].configuration.computation;
    const std::vector<RoundCost> costs =
        computation == report_.reference ? reference : take_turn(computation, types);
    for (const std::size_t i : group) {
      Trial& trial = report_.trials[i];
      trial.rounds.resize(round);
      trial.rounds.push_back(cost_of(costs, trial.configuration.dtype));
      trial.rounds.back().reference_s = cost_of(reference, manifest_.output.dtype).conversion_s;
      kept_->save(trial);
    }
  }
}

void Comparison::find_real(const Group& group, const RealPart& part) {
  const Computation& computation = report_.trials[group.front()].configuration.computation;
  std::vector<StoredType> dtypes;
  for (const std::size_t i : group) dtypes.push_back(report_.trials[i].configuration.dtype);
  const std::vector<RealismScores> scores = real_scores(part, job_of(computation, dtypes.front()),
                                                        computation.size, dtypes, threads_, [&] {
                                                          check_stop();
                                                          advance();
                                                        });
  for (std::size_t k = 0; k < group.size(); ++k) {
    Trial& trial = report_.trials[group[k]];
    trial.real[part.content] = scores[k];
    kept_->save(trial);
  }
}

Comparison::Work Comparison::work_left() const {
  Work work;
  work.losses =
      groups([](const Trial& trial) { return trial.losses.empty() && trial.quarantined == 0; });
  for (int round = 0; round < options_.rounds; ++round) {
    work.rounds.push_back(
        groups([&](const Trial& trial) { return std::ssize(trial.rounds) <= round; }));
  }
  for (const RealPart& part : real_) {
    work.real.push_back(
        groups([&](const Trial& trial) { return !trial.real.contains(part.content); }));
  }
  return work;
}

/// Processor time of a pair with a computation, tried on one or two; 0 if none can be.
double Comparison::pair_s(const Computation& computation) const {
  check_stop();
  Computation whole = computation;  // as large as the plan's shards say
  whole.size = 1;
  const JobManifest job = job_of(whole, manifest_.output.dtype);
  return measure_trial(job, job_, *load_generator(job).generator, 1, 1).seconds_per_pair *
         computation.size * computation.size;
}

/// The same of comparing a volume with the reference's.
double Comparison::scoring_s() const {
  const PlannedShard& shard = reference_pairs_.shards.front();
  const VolumeShape shape{manifest_.volume.bins, shard.volume_size};
  const std::vector<float> volume(shape.value_count(), 0.5f);
  const std::vector<std::uint8_t> nowhere(shape.size.pixel_count());
  const std::int64_t start_ns = thread_processor_ns();
  pair_loss(volume, volume, shape, nowhere);
  return 1e-9 * static_cast<double>(thread_processor_ns() - start_ns);
}

/// Tells how much there is to do, and begins to show how it goes on.
void Comparison::announce(const Work& work) {
  std::map<std::string, double> tried_s;
  const auto pair_of = [&](const Computation& computation) {
    const auto [tried, is_new] = tried_s.try_emplace(name_of(computation));
    if (is_new) tried->second = pair_s(computation);
    return tried->second;
  };
  const auto of = [&](const Group& group) -> const Computation& {
    return report_.trials[group.front()].configuration.computation;
  };
  std::int64_t steps = 0;
  double processor_s = 0;
  const auto add = [&](std::int64_t pairs, double seconds) {
    steps += pairs;
    processor_s += static_cast<double>(pairs + 1) * seconds;  // one warms up
  };
  const double score_s = scoring_s();
  for (const Group& group : work.losses) {
    add(report_.pairs, pair_of(report_.reference) + pair_of(of(group)) +
                           static_cast<double>(group.size()) * score_s);
  }
  for (const std::vector<Group>& round : work.rounds) {
    if (!round.empty()) add(report_.pairs, pair_of(report_.reference));
    for (const Group& group : round) {
      if (of(group) != report_.reference) add(report_.pairs, pair_of(of(group)));
    }
  }
  for (std::size_t i = 0; i < real_.size(); ++i) {
    for (const Group& group : work.real[i]) {
      add(std::ssize(real_[i].intervals),
          pair_of(of(group)) + static_cast<double>(group.size()) * score_s);
    }
  }
  if (options_.tell) {
    const auto counted = [](std::int64_t count, const char* noun) {
      return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
    };
    options_.tell(fmt::format(
        "{}, {}, {}: {}", counted(std::ssize(report_.trials), "configuration"),
        counted(report_.pairs, "pair"), counted(options_.rounds, "round"),
        steps == 0 ? "all measured before"
                   : "about " + duration_text(std::max(processor_s / threads_, 1.0), "hms")));
  }
  if (options_.make_progress && steps > 0) progress_ = options_.make_progress(steps);
}

TradeoffReport Comparison::run() {
  if (samples_.empty()) {
    throw InputError("expected pairs to compare, got none, in " + manifest_.name);
  }
  kept_ = std::make_unique<KeptTrials>(options_.out);
  report_.job = manifest_.name;
  report_.processor = processor_text();
  report_.threads = threads_;
  report_.reference = choose_reference();
  report_.reference_dtype = manifest_.output.dtype;

  reference_pairs_ = read_pairs(report_.reference.size);
  for (const SampleMessage& pair : reference_pairs_.pairs) {
    if (pair.failed()) {
      report_.skipped.push_back(pair.planned().sample_id + ": " + pair.sample.fault);
    }
  }
  report_.pairs = std::ssize(samples_) - std::ssize(report_.skipped);
  if (report_.pairs == 0) {
    throw InputError(
        fmt::format("expected pairs to compare, got none that can be read of {}, in "
                    "{}\n  {}",
                    samples_.size(), manifest_.name, report_.skipped.front()));
  }
  choose_trials();
  for (const auto& recording : options_.real) {
    real_.push_back(part_of(*recording, options_.pairs, manifest_.volume.bins, threads_));
  }

  const Work work = work_left();
  announce(work);
  for (const Group& group : work.losses) find_losses(group);
  for (std::size_t i = 0; i < real_.size(); ++i) {
    for (const Group& group : work.real[i]) find_real(group, real_[i]);
  }
  for (std::size_t round = 0; round < work.rounds.size(); ++round) {
    if (!work.rounds[round].empty()) run_round(round, work.rounds[round]);
  }
  if (progress_) progress_->finish();
  for (Trial& trial : report_.trials) {  // an earlier run may have had more
    trial.rounds.resize(static_cast<std::size_t>(options_.rounds));
    std::map<std::string, RealismScores> by_name;
    for (const RealPart& part : real_) by_name[part.recording.name()] = trial.real.at(part.content);
    trial.real = std::move(by_name);
  }
  return std::move(report_);
}

}  // namespace

TradeoffReport measure_tradeoff(const JobManifest& manifest, const TradeoffOptions& options) {
  return Comparison(manifest, options).run();
}

}  // namespace eventgan
