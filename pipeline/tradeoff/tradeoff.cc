#include "pipeline/tradeoff/tradeoff.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <span>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "pipeline/conversion/plan_summary.h"
#include "pipeline/generators/choose_engine.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/tradeoff/compared_pairs.h"
#include "pipeline/tradeoff/kept_trials.h"
#include "pipeline/tradeoff/measure_computation.h"
#include "pipeline/tradeoff/real_scores.h"
#include "stages/base/files/sha256.h"
#include "stages/base/processor/processor.h"
#include "stages/generator/shipped_weights.h"

namespace eventgan {

TradeoffAxes default_axes(const JobManifest& manifest) {
  TradeoffAxes axes;
  const GeneratorSpec& generator = manifest.generator;
  axes.methods = {GeneratorKind::kNetwork};
  if (!has_weights(generator.kind)) axes.methods.push_back(generator.kind);
  for (const int width : shipped_widths()) {
    axes.weights.push_back("shipped:" + std::to_string(width));
  }
  const std::string own = shipped_weights_name(generator.weights);
  if (has_weights(generator.kind) && std::ranges::find(axes.weights, own) == axes.weights.end()) {
    axes.weights.push_back(own);
  }
  axes.precisions = {Precision::kFloat32, Precision::kBfloat16, Precision::kInt8};
  axes.sizes = {1};
  axes.scopes = {generator.scope.scope};
  axes.dtypes = {manifest.output.dtype};
  return axes;
}

namespace {

/// "Intel(R) Xeon(R) Processor, avx512_core_vnni".
std::string processor_text() {
  return processor_name() + ", " + engine_support(Precision::kFloat32).processor;
}

class Comparison {
 public:
  Comparison(const JobManifest& manifest, const TradeoffOptions& options)
      : manifest_(manifest),
        options_(options),
        threads_(thread_count(options.threads)),
        job_(manifest, options.pairs, options.stop_requested) {}

  TradeoffReport run();

 private:
  /// What runs a computation, found out once; a reason if nothing can.
  struct Able {
    std::string description;  ///< of weights and engine, all that decides its volumes
    int base_channels = 0;
    std::string reason;
  };

  Able look_at(const Computation& computation) const;
  Computation choose_reference() const;
  void choose_trials();

  /// Trials, by index, of one computation.
  using Group = std::vector<std::size_t>;
  const Computation& computation_of(const Group& group) const {
    return report_.trials[group.front()].configuration.computation;
  }
  std::vector<StoredType> dtypes_of(const Group& group) const {
    std::vector<StoredType> dtypes;
    for (const std::size_t i : group) dtypes.push_back(report_.trials[i].configuration.dtype);
    return dtypes;
  }
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
  void run_round(std::size_t round, const std::vector<Group>& lacking);
  void find_real(const Group& group, const RealPart& part);
  void advance() {
    const std::lock_guard lock(telling_);
    if (progress_) progress_->advance(false, 0);
  }

  const JobManifest& manifest_;
  const TradeoffOptions& options_;
  int threads_;
  ComparedJob job_;
  TradeoffReport report_;
  std::optional<ComparedPairs> pairs_;  ///< once the reference is known
  std::vector<RealPart> real_;
  std::unique_ptr<KeptTrials> kept_;
  std::unique_ptr<Progress> progress_;
  std::mutex telling_;
};

Comparison::Able Comparison::look_at(const Computation& computation) const {
  Able able;
  JobManifest job;
  try {
    job = job_.as(computation, manifest_.output.dtype).manifest;
  } catch (const UsageError& error) {
    able.reason = error.what();
    return able;
  }
  if (has_weights(computation.method)) {
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
  for (const auto& [field, value] : job_.planned.plan.fingerprint) {
    common += field + "=" + value + "\n";
  }
  // The fingerprint has frames by name and size.
  for (const SampleMessage& pair : pairs_->reference().pairs) {
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
      trial.lines = job_.as(computation, dtype).lines;
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

template <class Lacks>
std::vector<Comparison::Group> Comparison::groups(Lacks lacks) const {
  std::vector<Group> all;
  for (std::size_t i = 0; i < report_.trials.size(); ++i) {
    if (!lacks(report_.trials[i])) continue;
    if (all.empty() || computation_of(all.back()) != computation_of({i})) all.emplace_back();
    all.back().push_back(i);
  }
  // Sizes together, so that the pairs of each are read once.
  std::ranges::stable_sort(all, std::ranges::greater(),
                           [&](const Group& group) { return computation_of(group).size; });
  return all;
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
  job_.check_stop();
  Computation whole = computation;  // as large as the plan's shards say
  whole.size = 1;
  const JobManifest job = job_.as(whole, manifest_.output.dtype).manifest;
  return measure_trial(job, job_.planned, *load_generator(job).generator, 1, 1).seconds_per_pair *
         computation.size * computation.size;
}

/// The same of comparing a volume with the reference's.
double Comparison::scoring_s() const {
  const PlannedShard& shard = pairs_->reference().shards.front();
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
  std::int64_t steps = 0;
  double processor_s = 0;
  const auto add = [&](std::int64_t pairs, double seconds) {
    steps += pairs;
    processor_s += static_cast<double>(pairs + 1) * seconds;  // one warms up
  };
  const double score_s = scoring_s();
  for (const Group& group : work.losses) {
    add(report_.pairs, pair_of(report_.reference) + pair_of(computation_of(group)) +
                           static_cast<double>(group.size()) * score_s);
  }
  for (const std::vector<Group>& round : work.rounds) {
    if (!round.empty()) add(report_.pairs, pair_of(report_.reference));
    for (const Group& group : round) {
      if (computation_of(group) != report_.reference)
        add(report_.pairs, pair_of(computation_of(group)));
    }
  }
  for (std::size_t i = 0; i < real_.size(); ++i) {
    for (const Group& group : work.real[i]) {
      add(std::ssize(real_[i].intervals),
          pair_of(computation_of(group)) + static_cast<double>(group.size()) * score_s);
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

void Comparison::find_losses(const Group& group) {
  const std::vector<std::vector<PairLoss>> losses = measure_losses(
      *pairs_, computation_of(group), dtypes_of(group), threads_, [&] { advance(); });
  for (std::size_t k = 0; k < group.size(); ++k) {
    Trial& trial = report_.trials[group[k]];
    trial.losses = losses[k];
    trial.quarantined = report_.pairs - std::ssize(losses[k]);
    kept_->save(trial);
  }
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
  const auto turn_of = [&](const Computation& computation) {
    return take_turn(*pairs_, computation, types, threads_, [&] { advance(); });
  };
  const std::vector<RoundCost> reference = turn_of(report_.reference);
  for (const Group& group : lacking) {
    const Computation& computation = computation_of(group);
    const std::vector<RoundCost> costs =
        computation == report_.reference ? reference : turn_of(computation);
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
  const Computation& computation = computation_of(group);
  const std::vector<StoredType> dtypes = dtypes_of(group);
  const JobManifest job = job_.as(computation, dtypes.front()).manifest;
  const std::vector<RealismScores> scores =
      real_scores(part, job, computation.size, dtypes, threads_, [&] {
        job_.check_stop();
        advance();
      });
  for (std::size_t k = 0; k < group.size(); ++k) {
    Trial& trial = report_.trials[group[k]];
    trial.real[part.content] = scores[k];
    kept_->save(trial);
  }
}

TradeoffReport Comparison::run() {
  if (job_.samples.empty()) {
    throw InputError("expected pairs to compare, got none, in " + manifest_.name);
  }
  kept_ = std::make_unique<KeptTrials>(options_.out);
  report_.job = manifest_.name;
  report_.processor = processor_text();
  report_.threads = threads_;
  report_.reference = choose_reference();
  report_.reference_dtype = manifest_.output.dtype;

  pairs_.emplace(job_, report_.reference);
  for (const SampleMessage& pair : pairs_->reference().pairs) {
    if (pair.failed()) {
      report_.skipped.push_back(pair.planned().sample_id + ": " + pair.sample.fault);
    }
  }
  report_.pairs = std::ssize(job_.samples) - std::ssize(report_.skipped);
  if (report_.pairs == 0) {
    throw InputError(fmt::format("expected readable pairs to compare, got none of {}, in {}\n  {}",
                                 job_.samples.size(), manifest_.name, report_.skipped.front()));
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
