#include "pipeline/realism/volume_method.h"

#include <fmt/core.h>

#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "manifests/values/events.h"
#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "pipeline/runtime/threads.h"
#include "stages/events/event_volume.h"
#include "stages/events/simulation/simulate_pair.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_file.h"

namespace eventgan {
namespace {

class NetworkMethod final : public VolumeMethod {
 public:
  NetworkMethod(std::unique_ptr<Generator> generator, std::string weights)
      : generator_(std::move(generator)), weights_(std::move(weights)) {}

  std::string name() const override { return "network"; }
  std::string settings() const override { return "weights " + weights_; }
  int draws() const override { return 1; }

  std::vector<float> volume(const IntervalFrames& frames, int /*draw*/) const override {
    const ImageSize size = frames.previous.size;
    std::vector<float> volume(VolumeShape{generator_->bins(), size}.value_count());
    generator_->generate(network_input(frames), size, volume);
    return volume;
  }

 private:
  std::unique_ptr<Generator> generator_;
  std::string weights_;
};

Weights named_weights(const std::string& name) {
  const std::optional<WeightsName> parsed = parse_weights_name(name);
  if (!parsed || parsed->origin == WeightsOrigin::kUntrained) {
    throw UsageError("--weights: expected a file, shipped or shipped:WIDTH with WIDTH in 1.." +
                     std::to_string(kLargestNamedWidth) + ", got \"" + name + "\"");
  }
  if (parsed->origin == WeightsOrigin::kFile) return read_weights(parsed->path);
  return read_shipped_weights(parsed->width ? *parsed->width : default_shipped_width());
}

}  // namespace

std::unique_ptr<VolumeMethod> make_network_method(std::unique_ptr<Generator> generator,
                                                  const std::string& weights) {
  return std::make_unique<NetworkMethod>(std::move(generator), weights);
}

std::unique_ptr<Generator> open_realism_generator(const std::string& weights) {
  const Weights named = named_weights(weights);
  return onednn_support(Precision::kFloat32).able
             ? make_onednn_generator(named, Precision::kFloat32)
             : make_torch_generator(named);
}

namespace {

constexpr double kLeastThreshold = 0.01;
constexpr double kLargestThreshold = 5;
constexpr double kSpreadShare = 0.15;

CounterRandom draw_random(const SimulatedScene& scene, const FrameInterval& interval, int draw,
                          std::uint64_t seed) {
  return CounterRandom(seed)
      .keyed("realism")
      .keyed(scene.name)
      .keyed(std::to_string(interval.first) + ":" + std::to_string(interval.last))
      .keyed(std::to_string(draw));
}

std::vector<Event> draw_events(const SimulatedScene& scene, const IntervalFrames& frames, int draw,
                               const SensorSpec& sensor, std::uint64_t seed) {
  return scene.events(frames, sensor, draw_random(scene, frames.interval, draw, seed));
}

class SimulatedMethod final : public VolumeMethod {
 public:
  SimulatedMethod(SimulatedScene scene, const SensorSpec& sensor, bool fitted, int bins,
                  std::uint64_t seed)
      : scene_(std::move(scene)), sensor_(sensor), fitted_(fitted), bins_(bins), seed_(seed) {}

  std::string name() const override { return scene_.name; }

  std::string settings() const override {
    const std::string text =
        fmt::format("contrast threshold {:.4g}{} of ln(u/255 + {:.4g})", sensor_.positive_threshold,
                    fitted_ ? " (fitted)" : "", sensor_.log_epsilon);
    return scene_.draws == 1 ? text : fmt::format("{}, mean of {} motions", text, scene_.draws);
  }

  int draws() const override { return scene_.draws; }

  std::vector<float> volume(const IntervalFrames& frames, int draw) const override {
    const VolumeShape shape{bins_, frames.previous.size};
    std::vector<float> volume(shape.value_count());
    pixel_event_volume(draw_events(scene_, frames, draw, sensor_, seed_), shape, volume);
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

SimulatedScene difference_scene() {
  return {"difference",
          [](const IntervalFrames& frames, const SensorSpec& sensor, CounterRandom random) {
            return simulate_difference(frames.previous, frames.next, sensor, frames.duration_s,
                                       random, EventOrder::kPixel);
          },
          1};
}

SimulatedScene esim_scene(double displacement_px, int draws) {
  return {"esim",
          [=](const IntervalFrames& frames, const SensorSpec& sensor, CounterRandom random) {
            return simulate_affine(frames.previous, displacement_px * frames.interval.gap(), sensor,
                                   frames.duration_s, random, EventOrder::kPixel);
          },
          draws};
}

SensorSpec realism_sensor(double threshold, double log_epsilon) {
  SensorSpec sensor;
  sensor.positive_threshold = threshold;
  sensor.negative_threshold = threshold;
  sensor.threshold_spread = kSpreadShare * threshold;
  sensor.log_epsilon = log_epsilon;
  return sensor;
}

std::unique_ptr<VolumeMethod> make_simulated_method(SimulatedScene scene, const SensorSpec& sensor,
                                                    bool fitted, int bins, std::uint64_t seed) {
  return std::make_unique<SimulatedMethod>(std::move(scene), sensor, fitted, bins, seed);
}

double fitted_threshold(const SimulatedScene& scene, std::span<const IntervalFrames> frames,
                        double log_epsilon, std::uint64_t seed, int threads) {
  double wanted = 0;
  for (const IntervalFrames& interval : frames) {
    wanted += static_cast<double>(interval.event_count);
  }
  const auto made = [&](double threshold) {
    const SensorSpec sensor = realism_sensor(threshold, log_epsilon);
    const auto draws = static_cast<std::size_t>(scene.draws);
    std::vector<std::size_t> counts(frames.size() * draws);
    for_each_index(counts.size(), threads, [&](std::size_t i) {
      counts[i] =
          draw_events(scene, frames[i / draws], static_cast<int>(i % draws), sensor, seed).size();
    });
    return static_cast<double>(std::accumulate(counts.begin(), counts.end(), std::size_t{0})) /
           scene.draws;
  };
  constexpr int kMostSteps = 16;  // 500^(1/2^16): far below the tolerance
  constexpr double kTolerance = 0.005;
  double low = kLeastThreshold;
  double high = kLargestThreshold;
  for (int step = 0; step < kMostSteps; ++step) {
    const double middle = std::sqrt(low * high);
    const double count = made(middle);
    if (wanted > 0 && std::abs(count - wanted) <= kTolerance * wanted) return middle;
    (count > wanted ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

}  // namespace eventgan
