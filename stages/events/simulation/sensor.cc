#include "stages/events/simulation/sensor.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tuple>

#include "manifests/values/gaussian_random.h"

namespace eventgan {

std::vector<float> linear_intensity(const GreyImage& image) {
  const ImageSize& size = image.size;
  if (size.height < 1 || size.width < 1 || image.pixels.size() != size.pixel_count()) {
    throw std::invalid_argument("expected an image, got " + to_string(size) + " with " +
                                std::to_string(image.pixels.size()) + " pixels");
  }
  std::vector<float> intensity(image.pixels.size());
  std::ranges::transform(image.pixels, intensity.begin(),
                         [](std::uint8_t value) { return static_cast<float>(value) / 255.0f; });
  return intensity;
}

std::vector<float> draw_thresholds(double mean, double spread, std::size_t pixel_count,
                                   CounterRandom random) {
  std::vector<float> thresholds(pixel_count);
  for (std::size_t pixel = 0; pixel < pixel_count; ++pixel) {
    const double drawn = spread > 0 ? mean + spread * gaussian(random, pixel) : mean;
    thresholds[pixel] = std::max(static_cast<float>(drawn), kSmallestThreshold);
  }
  return thresholds;
}

PixelNoise::PixelNoise(const SensorSpec& spec, std::size_t pixel_count, double start_s,
                       CounterRandom random)
    : shot_rate_hz_(spec.shot_noise_rate_hz),
      hot_rate_hz_(spec.hot_pixel_rate_hz),
      wait_random_(random.keyed("wait")),
      kind_random_(random.keyed("kind")),
      next_s_(pixel_count, start_s),
      draws_(pixel_count, 0),
      hot_(pixel_count, 0) {
  const CounterRandom hot_random = random.keyed("hot");
  for (std::size_t pixel = 0; pixel < pixel_count; ++pixel) {
    if (hot_random.uniform(2 * pixel) < spec.hot_pixel_fraction) {
      hot_[pixel] = hot_random.below(2 * pixel + 1, 2) == 0 ? -1 : 1;
    }
    draw_wait(pixel);
  }
}

bool PixelNoise::take(std::size_t pixel) {
  // One draw says which of the superposed processes this arrival belongs to.
  const std::uint64_t arrival = (draws_[pixel] - 1) * next_s_.size() + pixel;
  const double kind_hz = kind_random_.uniform(arrival) * rate_hz(pixel);
  draw_wait(pixel);
  if (kind_hz < shot_rate_hz_) return kind_hz < shot_rate_hz_ / 2;
  return hot_[pixel] > 0;
}

double PixelNoise::rate_hz(std::size_t pixel) const {
  return hot_[pixel] == 0 ? shot_rate_hz_ : shot_rate_hz_ + hot_rate_hz_;
}

void PixelNoise::draw_wait(std::size_t pixel) {
  const double rate = rate_hz(pixel);
  if (!(rate > 0)) {
    next_s_[pixel] = std::numeric_limits<double>::infinity();
    return;
  }
  const std::uint64_t arrival = draws_[pixel]++ * next_s_.size() + pixel;
  next_s_[pixel] -= std::log1p(-wait_random_.uniform(arrival)) / rate;
}

namespace {

/// Part of a step until a line that is at `difference` and moves by `change` over a whole step
/// reaches a threshold.
double until_crossing(double difference, double change, double positive_threshold,
                      double negative_threshold) {
  if (change > 0) return std::max((positive_threshold - difference) / change, 0.0);
  if (change < 0) return std::max((negative_threshold + difference) / -change, 0.0);
  return std::numeric_limits<double>::infinity();
}

/// Events that a resting pixel gives a second. Noise resets the level that leaks away, so it is not
/// the sum of both.
double idle_rate_hz(const SensorSpec& spec) {
  const double noise_hz =
      spec.shot_noise_rate_hz + spec.hot_pixel_fraction * spec.hot_pixel_rate_hz;
  const double rate_hz = std::max(noise_hz, spec.leak_rate_hz);
  return rate_hz / (1 + rate_hz * spec.refractory_s);
}

bool comes_before(const Event& left, const Event& right) {
  return std::tie(left.t_s, left.y, left.x, left.positive) <
         std::tie(right.t_s, right.y, right.x, right.positive);
}

bool is_intensity(float value) {
  return value >= 0 && value <= std::numeric_limits<float>::max();  // false for NaN
}

}  // namespace

double idle_event_bytes(const SensorSpec& spec, std::size_t pixel_count, double duration_s) {
  // A vector that grows holds its events twice for a moment.
  constexpr double kEventBytes = 2 * sizeof(Event);
  return idle_rate_hz(spec) * duration_s * static_cast<double>(pixel_count) * kEventBytes;
}

void check_events_fit(const SensorSpec& spec, ImageSize size, double duration_s,
                      std::size_t memory_bytes) {
  const double needed = idle_event_bytes(spec, size.pixel_count(), duration_s);
  if (needed <= static_cast<double>(memory_bytes)) return;
  throw std::runtime_error(fmt::format(
      "expected a sensor whose events fit into memory ({:.3g} bytes), got about {:.3g} events "
      "({:.3g} bytes) without any motion from {} pixels in {:g} s: shot_noise_rate_hz {:g}, "
      "hot_pixel_rate_hz {:g} of a share of {:g}, leak_rate_hz {:g}, refractory_s {:g}",
      static_cast<double>(memory_bytes), needed / (2 * sizeof(Event)), needed, to_string(size),
      duration_s, spec.shot_noise_rate_hz, spec.hot_pixel_rate_hz, spec.hot_pixel_fraction,
      spec.leak_rate_hz, spec.refractory_s));
}

/// The time from one image to the next. Times within are parts of it, 0..1, so that neither a
/// recording's absolute time nor a tiny step costs precision.
struct Sensor::Step {
  double start_s;
  double end_s;
  double duration_s;
  double earliest_s;  ///< smallest time after start_s: events lie in (start_s, end_s]
};

Sensor::Sensor(const SensorSpec& spec, ImageSize size, CounterRandom random)
    : spec_(spec),
      size_(size),
      random_(random),
      positive_threshold_(draw_thresholds(spec.positive_threshold, spec.threshold_spread,
                                          size.pixel_count(), random.keyed("positive threshold"))),
      negative_threshold_(draw_thresholds(spec.negative_threshold, spec.threshold_spread,
                                          size.pixel_count(), random.keyed("negative threshold"))) {
}

std::vector<Event> Sensor::step(std::span<const float> intensity, double t_s) {
  check(intensity, t_s);
  if (!noise_) {
    start(intensity, t_s);
    return {};
  }
  const Step step{time_s_, t_s, t_s - time_s_, std::nextafter(time_s_, t_s)};
  const double leak = spec_.leak_rate_hz * step.duration_s;  // in positive thresholds
  const auto epsilon = static_cast<float>(spec_.log_epsilon);
  std::vector<Event> events;
  for (std::size_t pixel = 0; pixel < intensity.size(); ++pixel) {
    const float after = std::log(intensity[pixel] + epsilon);
    const float log_change = after - log_intensity_[pixel];
    log_intensity_[pixel] = after;
    // Most pixels: a line between the thresholds at both ends crosses neither.
    const double end = difference_[pixel] + log_change + leak * positive_threshold_[pixel];
    if (end < positive_threshold_[pixel] && end > -negative_threshold_[pixel] &&
        noise_->next_s(pixel) > t_s && held_until_s_[pixel] <= step.start_s) {
      difference_[pixel] = end;
    } else {
      run_pixel(pixel, log_change, step, events);
    }
  }
  time_s_ = t_s;
  std::ranges::sort(events, comes_before);
  return events;
}

void Sensor::check(std::span<const float> intensity, double t_s) const {
  if (intensity.size() != size_.pixel_count()) {
    throw std::invalid_argument("expected " + std::to_string(size_.pixel_count()) +
                                " intensities, got " + std::to_string(intensity.size()));
  }
  if (!std::isfinite(t_s) || (noise_ && !(t_s > time_s_))) {
    throw std::invalid_argument("expected a time after " + std::to_string(time_s_) + " s, got " +
                                std::to_string(t_s) + " s");
  }
  const auto unsound = std::ranges::find_if_not(intensity, is_intensity);
  if (unsound != intensity.end()) {
    throw std::invalid_argument("expected intensities >= 0, got " + std::to_string(*unsound) +
                                " at pixel " + std::to_string(unsound - intensity.begin()));
  }
}

void Sensor::start(std::span<const float> intensity, double t_s) {
  const auto epsilon = static_cast<float>(spec_.log_epsilon);
  log_intensity_.resize(intensity.size());
  std::ranges::transform(intensity, log_intensity_.begin(),
                         [epsilon](float value) { return std::log(value + epsilon); });
  difference_.assign(intensity.size(), 0.0);
  held_until_s_.assign(intensity.size(), t_s);
  noise_.emplace(spec_, intensity.size(), t_s, random_.keyed("noise"));
  time_s_ = t_s;
}

void Sensor::run_pixel(std::size_t pixel, float log_change, const Step& step,
                       std::vector<Event>& events) {
  const double positive = positive_threshold_[pixel];
  const double negative = negative_threshold_[pixel];
  const double change = log_change + spec_.leak_rate_hz * step.duration_s * positive;
  // d is known at `now`: the step's start, the last reset, or the end of a refractory time.
  double now = std::max((held_until_s_[pixel] - step.start_s) / step.duration_s, 0.0);
  double difference = difference_[pixel];
  for (;;) {
    const double crossing = now + until_crossing(difference, change, positive, negative);
    const double noise = (noise_->next_s(pixel) - step.start_s) / step.duration_s;
    if (std::min(crossing, noise) > 1) break;
    bool is_positive = change > 0;
    if (noise <= crossing) {
      const bool held = noise_->next_s(pixel) < held_until_s_[pixel];
      is_positive = noise_->take(pixel);
      if (held) continue;
    }
    const double event = std::min(crossing, noise);
    const double event_s = step.start_s + event * step.duration_s;
    events.push_back({.x = static_cast<int>(pixel % static_cast<std::size_t>(size_.width)),
                      .y = static_cast<int>(pixel / static_cast<std::size_t>(size_.width)),
                      .t_s = std::clamp(event_s, step.earliest_s, step.end_s),
                      .positive = is_positive});
    difference = 0;
    now = event + spec_.refractory_s / step.duration_s;
    held_until_s_[pixel] = event_s + spec_.refractory_s;
  }
  difference_[pixel] = difference + change * std::max(1 - now, 0.0);
}

}  // namespace eventgan
