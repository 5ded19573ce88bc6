#include "pipeline/generators/simulated_generator.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/documents/manifest_fields.h"
#include "manifests/files/sha256.h"
#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"
#include "pipeline/runtime/memory.h"
#include "stages/base/processor_clones.h"
#include "stages/events/event_volume.h"
#include "stages/events/simulation/sensor.h"
#include "stages/events/simulation/simulate_pair.h"
#include "stages/generator/generator.h"

namespace eventgan {
namespace {

/// Grey values of [-1, 1], rounded to whole ones and half ones up; black of what is not a number.
EVENTGAN_CLONES void round_grey(std::span<const float> frame, std::span<std::uint8_t> grey) {
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const float u = (frame[i] / 2 + 0.5f) * 255;
    const float inside = std::min(std::max(0.0f, u), 255.0f);  // 0 for NaN
    // In halves, which are exact: a sum with 1/2 would round the number below 1/2 up.
    grey[i] = static_cast<std::uint8_t>((static_cast<int>(2 * inside) + 1) / 2);
  }
}

/// A frame in [-1, 1] as an image; what is not a number becomes black.
GreyImage grey_image(std::span<const float> frame, ImageSize size) {
  GreyImage image{size, std::vector<std::uint8_t>(frame.size())};
  round_grey(frame, image.pixels);
  return image;
}

/// A key of the two frames' content. Both have one size, and with it the key tells apart images
/// of the same bytes and another shape.
std::string content_key(const GreyImage& previous, const GreyImage& next) {
  Sha256 content;
  content.update(std::to_string(previous.size.width) + '\n');
  for (const GreyImage* frame : {&previous, &next}) {
    content.update(std::as_bytes(std::span(frame->pixels)));
  }
  return content.hex();
}

/// Images that are kept at once, or as much memory as a Sensor takes that sees one by one.
constexpr int kMostImages = 64;

/// The events of the frames between, from one to the next of which no point moves more than 1 px.
std::vector<Event> between_events(const SimulatorInput& pair) {
  const FramesBetween& between = *pair.between;
  constexpr double kRoundingPx = 1e-9;
  const int steps = std::max(1, static_cast<int>(std::ceil(between.displacement_px - kRoundingPx)));
  const auto image = [&](int step) {
    if (step == 0) return pair.previous;
    return step == steps ? pair.next : between.at(static_cast<double>(step) / steps);
  };
  const CounterRandom random = pair.random.keyed("sensor");
  const double duration_s = pair.duration_s;
  if (steps < kMostImages) {
    std::vector<GreyImage> images;
    for (int step = 0; step <= steps; ++step) images.push_back(image(step));
    return simulate_images(images, pair.sensor, duration_s, random);
  }
  Sensor sensor(pair.sensor, pair.previous.size, random);
  std::vector<Event> events;
  for (int step = 0; step <= steps; ++step) {
    const std::vector<Event> seen = sensor.step(linear_intensity(image(step)),
                                                duration_s * (static_cast<double>(step) / steps));
    events.insert(events.end(), seen.begin(), seen.end());
  }
  std::ranges::stable_sort(events, {},
                           [](const Event& event) { return std::pair(event.y, event.x); });
  return events;
}

std::vector<Event> esim_events(const SimulatorInput& pair) {
  if (pair.between != nullptr) return between_events(pair);
  return simulate_affine(pair.previous, pair.max_displacement_px, pair.sensor, pair.duration_s,
                         pair.random);
}

std::vector<Event> difference_events(const SimulatorInput& pair) {
  return simulate_difference(pair.previous, pair.next, pair.sensor, pair.duration_s, pair.random);
}

constexpr Simulator kSimulators[] = {{GeneratorKind::kEsim, esim_events},
                                     {GeneratorKind::kDifference, difference_events, fade_between}};

class SimulatedGenerator final : public Generator {
 public:
  SimulatedGenerator(const GeneratorSpec& spec, int bins, std::uint64_t seed)
      : model_(simulator(spec.kind)),
        spec_(spec),
        bins_(bins),
        random_(seed),
        memory_bytes_(memory_limit_bytes()) {}

  int bins() const override { return bins_; }

  /// At most half of the memory, which leaves one call at a time; `generate` says what is too much.
  std::size_t working_bytes(ImageSize size) const override {
    double needed = idle_event_bytes(spec_.sensor, size.pixel_count(), spec_.duration_s);
    if (generator_row(spec_.kind).sees_between) {
      needed += kMostImages * static_cast<double>(size.pixel_count());
    }
    return static_cast<std::size_t>(std::min(needed, static_cast<double>(memory_bytes_) / 2));
  }

  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    check_generator_spans(pair, volume, bins_);
    check_events_fit(spec_.sensor, pair.size, spec_.duration_s, memory_bytes_);
    const std::size_t pixels = pair.size.pixel_count();
    const GreyImage previous = grey_image(pair.frames.first(pixels), pair.size);
    const GreyImage next = grey_image(pair.frames.last(pixels), pair.size);
    CounterRandom random = random_.keyed(content_key(previous, next));
    if (pair.draw != 0) random = random.keyed(std::to_string(pair.draw));
    pixel_event_volume(model_.events({previous, next, spec_.duration_s, spec_.max_displacement_px,
                                      sensor_of(pair), random, pair.between}),
                       {bins_, pair.size}, volume);
    return {};
  }

  std::string description() const override {
    nlohmann::json json = {{"model", to_string(spec_.kind)},
                           {"duration_s", spec_.duration_s},
                           {"sensor", nlohmann::json::parse(to_json(spec_.sensor))}};
    if (takes(generator_row(spec_.kind), "max_displacement_px")) {
      json["max_displacement_px"] = spec_.max_displacement_px;
    }
    if (spec_.threshold) {
      json["threshold"] = spec_.threshold->range;
      json["threshold_ratio"] = spec_.threshold->ratio;
    }
    return "simulation " + json.dump();
  }

 private:
  SensorSpec sensor_of(const GeneratorInput& pair) const {
    if (!pair.threshold) return spec_.sensor;
    return spec_.threshold.value_or(ThresholdSpec()).applied(spec_.sensor, *pair.threshold);
  }

  const Simulator& model_;
  GeneratorSpec spec_;
  int bins_;
  CounterRandom random_;
  std::size_t memory_bytes_;
};

}  // namespace

const Simulator& simulator(GeneratorKind kind) {
  const auto* const found = std::ranges::find(kSimulators, kind, &Simulator::kind);
  if (found == std::end(kSimulators)) {
    throw std::invalid_argument("expected a kind of simulator, got " +
                                std::string(to_string(kind)));
  }
  return *found;
}

std::unique_ptr<Generator> make_simulated_generator(const GeneratorSpec& spec, int bins,
                                                    std::uint64_t seed) {
  return std::make_unique<SimulatedGenerator>(spec, bins, seed);
}

}  // namespace eventgan
