#include "pipeline/realism/volume_method.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "manifests/files/sha256.h"
#include "manifests/values/events.h"
#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/generators/simulated_generator.h"
#include "pipeline/runtime/threads.h"
#include "stages/events/drawn_events.h"
#include "stages/events/event_volume.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/weights_file.h"

namespace eventgan {
bool is_at_end(double threshold, const ThresholdRange& range) {
  constexpr double kNear = 1.01;
  return threshold <= range.lowest * kNear || threshold >= range.highest / kNear;
}

namespace {

std::vector<float> network_volume(const Generator& generator, const IntervalFrames& frames,
                                  std::optional<ContrastThreshold> threshold) {
  const ImageSize size = frames.previous.size;
  std::vector<float> volume(VolumeShape{generator.bins(), size}.value_count());
  generator.generate({network_input(frames), size, threshold}, volume);
  return volume;
}

CounterRandom draw_random(const std::string& method, const FrameInterval& interval, int draw,
                          std::uint64_t seed) {
  return CounterRandom(seed)
      .keyed("realism")
      .keyed(method)
      .keyed(std::to_string(interval.first) + ":" + std::to_string(interval.last))
      .keyed(std::to_string(draw));
}

std::string threshold_text(const ContrastThreshold& threshold, bool fitted,
                           const ThresholdRange& range, double log_epsilon) {
  const std::string how =
      !fitted ? ""
      : is_at_end(threshold.positive(), range) || is_at_end(threshold.negative(), range)
          ? fmt::format(" (none of {:.4g}..{:.4g} makes as many events)", range.lowest,
                        range.highest)
          : " (fitted)";
  const std::string text = fmt::format("contrast threshold {:.4g}{} of ln(u/255 + {:.4g})",
                                       threshold.mean, how, log_epsilon);
  if (threshold.ratio == 1) return text;
  return text + fmt::format(", negative ÷ positive {:.3g}", threshold.ratio);
}

class NetworkMethod final : public VolumeMethod {
 public:
  NetworkMethod(std::unique_ptr<Generator> generator, std::string weights,
                std::optional<ContrastThreshold> threshold, bool fitted, std::uint64_t seed)
      : generator_(std::move(generator)),
        weights_(std::move(weights)),
        threshold_(threshold),
        fitted_(fitted),
        seed_(seed) {}

  std::string name() const override { return "network"; }
  std::string settings() const override {
    const std::string text = "weights " + weights_;
    if (!threshold_) return text;
    return fmt::format(
        "{}, {}, mean of {} draws of events", text,
        threshold_text(*threshold_, fitted_, generator_->thresholds().value(), kFrameLogEpsilon),
        draws());
  }
  int draws() const override { return threshold_ ? 5 : 1; }

  std::vector<float> volume(const IntervalFrames& frames, int draw) const override {
    std::vector<float> volume = network_volume(*generator_, frames, threshold_);
    if (!threshold_) return volume;
    draw_events(volume, {generator_->bins(), frames.previous.size},
                draw_random(name(), frames.interval, draw, seed_));
    return normalized(std::move(volume));
  }

 private:
  std::unique_ptr<Generator> generator_;
  std::string weights_;
  std::optional<ContrastThreshold> threshold_;
  bool fitted_;
  std::uint64_t seed_;
};

}  // namespace

std::unique_ptr<VolumeMethod> make_network_method(std::unique_ptr<Generator> generator,
                                                  const std::string& weights,
                                                  std::optional<ContrastThreshold> threshold,
                                                  bool fitted, std::uint64_t seed) {
  return std::make_unique<NetworkMethod>(std::move(generator), weights, threshold, fitted, seed);
}

NamedNetwork open_network(const std::string& weights) {
  const std::optional<WeightsName> name = parse_weights_name(weights);
  if (!name || name->origin == WeightsOrigin::kUntrained) {
    throw UsageError(
        "--weights: expected a file, shipped, shipped:sensor or shipped:WIDTH with WIDTH in 1.." +
        std::to_string(kLargestNamedWidth) + ", got \"" + weights + "\"");
  }
  if (name->origin == WeightsOrigin::kFile) {
    return {make_fastest_generator(read_weights(name->path)), sha256_of_file(name->path)};
  }
  const int width = name->width ? *name->width : default_shipped_width();
  return {make_fastest_generator(read_shipped_weights(width)),
          sha256_hex(shipped_weights_bytes(width))};
}

namespace {

std::vector<Event> simulated_events(const SimulatedScene& scene, const IntervalFrames& frames,
                                    int draw, const SensorSpec& sensor, std::uint64_t seed) {
  return scene.events(frames, sensor, draw_random(scene.name, frames.interval, draw, seed));
}

class SimulatedMethod final : public VolumeMethod {
 public:
  SimulatedMethod(SimulatedScene scene, const SensorSpec& sensor, bool fitted, int bins,
                  std::uint64_t seed)
      : scene_(std::move(scene)), sensor_(sensor), fitted_(fitted), bins_(bins), seed_(seed) {}

  std::string name() const override { return scene_.name; }

  std::string settings() const override {
    const double positive = sensor_.positive_threshold, negative = sensor_.negative_threshold;
    const std::string text =
        threshold_text({std::sqrt(positive * negative), negative / positive}, fitted_,
                       {kLeastFittedThreshold, kMostFittedThreshold}, sensor_.log_epsilon);
    return scene_.draws == 1 ? text : fmt::format("{}, mean of {} motions", text, scene_.draws);
  }

  int draws() const override { return scene_.draws; }

  std::vector<float> volume(const IntervalFrames& frames, int draw) const override {
    const VolumeShape shape{bins_, frames.previous.size};
    std::vector<float> volume(shape.value_count());
    pixel_event_volume(simulated_events(scene_, frames, draw, sensor_, seed_), shape, volume);
    return normalized(std::move(volume));
  }

 private:
  SimulatedScene scene_;
  SensorSpec sensor_;
  bool fitted_;
  int bins_;
  std::uint64_t seed_;
};

}  // namespace

SimulatedScene simulated_scene(GeneratorKind kind, double displacement_px, int draws) {
  const GeneratorRow& row = generator_row(kind);
  return {std::string(row.word),
          [=, events = simulator(kind).events](const IntervalFrames& frames,
                                               const SensorSpec& sensor, CounterRandom random) {
            return events({frames.previous, frames.next, frames.duration_s,
                           displacement_px * frames.interval.gap(), sensor, random});
          },
          row.moves_one_frame ? draws : 1};
}

SensorSpec realism_sensor(const ContrastThreshold& threshold, double log_epsilon) {
  return ThresholdSpec().applied({.log_epsilon = log_epsilon}, threshold);
}

std::unique_ptr<VolumeMethod> make_simulated_method(SimulatedScene scene, const SensorSpec& sensor,
                                                    bool fitted, int bins, std::uint64_t seed) {
  return std::make_unique<SimulatedMethod>(std::move(scene), sensor, fitted, bins, seed);
}

namespace {

/// Looks for the threshold that gives as many events as are wanted, fewer the higher it is.
class Bisection {
 public:
  Bisection(double wanted, const ThresholdRange& range) : wanted_(wanted), range_(range) {}

  double threshold() const { return range_.geometric_mean(); }
  /// Within 0.5 %.
  bool is_near(double count) const {
    return wanted_ > 0 && std::abs(count - wanted_) <= 0.005 * wanted_;
  }
  void take(double count) { (count > wanted_ ? range_.lowest : range_.highest) = threshold(); }

 private:
  double wanted_;
  ThresholdRange range_;
};

constexpr int kMostSteps = 16;  // 500^(1/2^16): far below the tolerance

double event_count(std::span<const IntervalFrames> frames, std::int64_t IntervalFrames::*member) {
  double count = 0;
  for (const IntervalFrames& interval : frames) count += static_cast<double>(interval.*member);
  return count;
}

}  // namespace

std::vector<PolarityCounts> made_events(const SimulatedScene& scene,
                                        std::span<const IntervalFrames> frames,
                                        const SensorSpec& sensor, std::uint64_t seed, int threads) {
  const auto draws = static_cast<std::size_t>(scene.draws);
  std::vector<PolarityCounts> of_draws(frames.size() * draws);
  for_each_index(of_draws.size(), threads, [&](std::size_t i) {
    const std::vector<Event> events =
        simulated_events(scene, frames[i / draws], static_cast<int>(i % draws), sensor, seed);
    const auto positive = std::ranges::count(events, true, &Event::positive);
    of_draws[i] = {static_cast<double>(positive),
                   static_cast<double>(std::ssize(events) - positive)};
  });
  std::vector<PolarityCounts> counts(frames.size());
  for (std::size_t i = 0; i < of_draws.size(); ++i) {
    for (const std::size_t p : {0, 1}) counts[i / draws][p] += of_draws[i][p] / scene.draws;
  }
  return counts;
}

std::vector<PolarityCounts> made_events(const Generator& generator,
                                        std::span<const IntervalFrames> frames,
                                        const ContrastThreshold& threshold, int threads) {
  std::vector<PolarityCounts> counts(frames.size());
  for_each_index(frames.size(), threads, [&](std::size_t i) {
    const std::vector<float> rates = network_volume(generator, frames[i], threshold);
    const auto middle = rates.begin() + static_cast<std::ptrdiff_t>(rates.size() / 2);
    counts[i] = {std::accumulate(rates.begin(), middle, 0.0),
                 std::accumulate(middle, rates.end(), 0.0)};
  });
  return counts;
}

namespace {

PolarityCounts sum_of(const std::vector<PolarityCounts>& counts) {
  PolarityCounts sum{};
  for (const auto& [positive, negative] : counts) {
    sum[0] += positive;
    sum[1] += negative;
  }
  return sum;
}

}  // namespace

double fitted_threshold(double wanted, const std::function<double(double threshold)>& made) {
  Bisection bisection(wanted, {kLeastFittedThreshold, kMostFittedThreshold});
  for (int step = 0; step < kMostSteps; ++step) {
    const double count = made(bisection.threshold());
    if (bisection.is_near(count)) break;
    bisection.take(count);
  }
  return bisection.threshold();
}

double fitted_threshold(const SimulatedScene& scene, std::span<const IntervalFrames> frames,
                        double log_epsilon, std::uint64_t seed, int threads) {
  return fitted_threshold(event_count(frames, &IntervalFrames::event_count), [&](double threshold) {
    const SensorSpec sensor = realism_sensor({threshold}, log_epsilon);
    const auto [positive, negative] = sum_of(made_events(scene, frames, sensor, seed, threads));
    return positive + negative;
  });
}

ContrastThreshold fitted_threshold(const Generator& generator,
                                   std::span<const IntervalFrames> frames, int threads) {
  const double positive_count = event_count(frames, &IntervalFrames::positive_count);
  const double all = event_count(frames, &IntervalFrames::event_count);
  const ThresholdRange range = generator.thresholds().value();
  Bisection positive(positive_count, range);
  Bisection negative(all - positive_count, range);
  ContrastThreshold threshold;
  for (int step = 0; step < kMostSteps; ++step) {
    threshold = {std::sqrt(positive.threshold() * negative.threshold()),
                 negative.threshold() / positive.threshold()};
    const PolarityCounts counts = sum_of(made_events(generator, frames, threshold, threads));
    if (positive.is_near(counts[0]) && negative.is_near(counts[1])) break;
    positive.take(counts[0]);
    negative.take(counts[1]);
  }
  return threshold;
}

}  // namespace eventgan
