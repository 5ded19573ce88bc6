#include "pipeline/tradeoff/tradeoff.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "manifests/values/weights.h"
#include "pipeline/conversion/plan_summary.h"
#include "pipeline/generators/choose_engine.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/tradeoff/compared_pairs.h"
#include "pipeline/tradeoff/measure_computation.h"
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
  /// Whether a computation can be run, found out once.
  struct Able {
    int base_channels = 0;
    std::string reason;  ///< why not
  };

  Able look_at(const Computation& computation) const;
  Computation choose_reference() const;
  void choose_trials();

  /// The trials of one computation, one for each stored type of the axes.
  struct Group {
    Computation computation;
    std::size_t first = 0;  ///< in the report
  };

  double pair_s(const Computation& computation) const;
  double scoring_s() const;
  void announce();

  void find_losses(const Group& group);
  void find_real(const Group& group, const RealPart& part);
  void run_round();
  void advance() {
    const std::lock_guard lock(telling_);
    if (progress_) progress_->advance(false, 0);
  }

  const JobManifest& manifest_;
  const TradeoffOptions& options_;
  int threads_;
  ComparedJob job_;
  TradeoffReport report_;
  std::vector<Group> groups_;           ///< those of a size together: its pairs are read once
  std::optional<ComparedPairs> pairs_;  ///< once the reference is known
  std::vector<RealPart> real_;
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
    const bool is_wanted = computation.precision == Precision::kFloat32 ||
                           computation.precision == manifest_.generator.precision;
    if (options_.only_native && !is_wanted && !support.native) {
      able.reason = fmt::format("this processor ({}) has no instructions for {}", support.processor,
                                to_string(computation.precision));
      return able;
    }
  }
  try {
    load_generator(job);
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
    const Able able = look_at(candidate);
    if (!able.reason.empty() || able.base_channels <= channels) continue;
    widest = candidate;
    channels = able.base_channels;
  }
  if (channels == 0) {
    throw UsageError(
        "--widths: expected weights to compare with that the manifest's settings fit, "
        "got none");
  }
  return widest;
}

void Comparison::choose_trials() {
  report_.own = own_configuration(manifest_);
  const Able reference = look_at(report_.reference);
  if (!reference.reason.empty()) {
    throw UsageError("--reference: expected a configuration that can be run, got " +
                     name_of(report_.reference) + ": " + reference.reason);
  }
  for (const Computation& computation : computations(options_.axes)) {
    const Able able = look_at(computation);
    if (!able.reason.empty()) {
      report_.refused.push_back({computation, able.reason});
      continue;
    }
    groups_.push_back({computation, report_.trials.size()});
    for (const StoredType dtype : options_.axes.dtypes) {
      Trial trial;
      trial.configuration = {computation, dtype};
      trial.lines = job_.as(computation, dtype).lines;
      report_.trials.push_back(std::move(trial));
    }
  }
  std::ranges::stable_sort(groups_, std::ranges::greater(),
                           [](const Group& group) { return group.computation.size; });
  if (report_.trials.empty()) {
    throw UsageError(
        "expected a configuration that can be run, got none: " +
        (report_.refused.empty() ? "the axes are empty" : report_.refused.front().reason));
  }
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
void Comparison::announce() {
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
  const double scores_s = static_cast<double>(options_.axes.dtypes.size()) * scoring_s();
  const double reference_s = pair_of(report_.reference);
  add(options_.rounds * report_.pairs, reference_s);
  for (const Group& group : groups_) {
    const double group_s = pair_of(group.computation);
    add(report_.pairs, reference_s + group_s + scores_s);
    for (const RealPart& part : real_) add(std::ssize(part.intervals), group_s + scores_s);
    if (group.computation != report_.reference) add(options_.rounds * report_.pairs, group_s);
  }
  if (options_.tell) {
    options_.tell(
        fmt::format("{}, {}, {}: about {}", count_text(std::ssize(report_.trials), "configuration"),
                    count_text(report_.pairs, "pair"), count_text(options_.rounds, "round"),
                    duration_text(std::max(processor_s / threads_, 1.0), "hms")));
  }
  if (options_.make_progress) progress_ = options_.make_progress(steps);
}

void Comparison::find_losses(const Group& group) {
  const std::vector<std::vector<PairLoss>> losses = measure_losses(
      *pairs_, group.computation, options_.axes.dtypes, threads_, [&] { advance(); });
  for (std::size_t k = 0; k < losses.size(); ++k) {
    Trial& trial = report_.trials[group.first + k];
    trial.losses = losses[k];
    trial.quarantined = report_.pairs - std::ssize(losses[k]);
  }
}

void Comparison::find_real(const Group& group, const RealPart& part) {
  const std::vector<StoredType>& dtypes = options_.axes.dtypes;
  const JobManifest job = job_.as(group.computation, dtypes.front()).manifest;
  const std::vector<RealismScores> scores =
      real_scores(part, job, group.computation.size, dtypes, threads_, [&] {
        job_.check_stop();
        advance();
      });
  for (std::size_t k = 0; k < scores.size(); ++k) {
    report_.trials[group.first + k].real[part.recording.name()] = scores[k];
  }
}

/// The reference first, with every stored type as the others have them: that costs a turn the same.
void Comparison::run_round() {
  std::vector<StoredType> types = options_.axes.dtypes;
  const auto own = std::ranges::find(types, manifest_.output.dtype) - types.begin();
  if (own == std::ssize(types)) types.push_back(manifest_.output.dtype);
  const auto turn_of = [&](const Computation& computation) {
    return take_turn(*pairs_, computation, types, threads_, [&] { advance(); });
  };
  const std::vector<RoundCost> reference = turn_of(report_.reference);
  for (const Group& group : groups_) {
    const bool is_reference = group.computation == report_.reference;
    const std::vector<RoundCost> costs = is_reference ? reference : turn_of(group.computation);
    for (std::size_t k = 0; k < options_.axes.dtypes.size(); ++k) {
      RoundCost& cost = report_.trials[group.first + k].rounds.emplace_back(costs.at(k));
      cost.reference_s = reference.at(static_cast<std::size_t>(own)).conversion_s;
    }
  }
}

TradeoffReport Comparison::run() {
  if (job_.samples.empty()) {
    throw InputError("expected pairs to compare, got none, in " + manifest_.name);
  }
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
    real_.push_back(part_of(*recording, options_.pairs));
  }

  announce();
  for (const Group& group : groups_) find_losses(group);
  for (const RealPart& part : real_) {
    for (const Group& group : groups_) find_real(group, part);
  }
  for (int round = 0; round < options_.rounds; ++round) run_round();
  if (progress_) progress_->finish();
  return std::move(report_);
}

}  // namespace

TradeoffReport measure_tradeoff(const JobManifest& manifest, const TradeoffOptions& options) {
  return Comparison(manifest, options).run();
}

}  // namespace eventgan
