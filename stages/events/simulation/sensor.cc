#include "stages/events/simulation/sensor.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>

#include "manifests/values/gaussian_random.h"
#include "stages/base/processor_clones.h"

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

namespace {

EVENTGAN_CLONES void draw_near_gaussians(const CounterRandom& random,
                                         std::span<const std::size_t> pixels,
                                         std::span<double> drawn) {
  for (std::size_t i = 0; i < pixels.size(); ++i) drawn[i] = near_gaussian(random, pixels[i]);
}

/// The thresholds of some pixels; `drawn` is memory for as many.
void draw_thresholds_of(std::span<const std::size_t> pixels, double mean, double spread,
                        const CounterRandom& random, std::vector<double>& drawn,
                        std::span<float> thresholds) {
  const auto at_least = [](float threshold) { return std::max(threshold, kSmallestThreshold); };
  if (!(spread > 0)) {
    std::ranges::fill(thresholds, at_least(static_cast<float>(mean)));
    return;
  }
  drawn.resize(pixels.size());
  draw_near_gaussians(random, pixels, drawn);
  const double error = spread * kNearGaussianError + mean * 1e-15;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double near = mean + spread * drawn[i];
    const auto threshold = static_cast<float>(near - error);
    // Nearly always all that is as near is one float.
    thresholds[i] = at_least(threshold == static_cast<float>(near + error)
                                 ? threshold
                                 : static_cast<float>(mean + spread * gaussian(random, pixels[i])));
  }
}

}  // namespace

std::vector<float> draw_thresholds(double mean, double spread, std::size_t pixel_count,
                                   CounterRandom random) {
  std::vector<std::size_t> pixels(pixel_count);
  std::iota(pixels.begin(), pixels.end(), std::size_t{0});
  std::vector<float> thresholds(pixel_count);
  std::vector<double> drawn;
  draw_thresholds_of(pixels, mean, spread, random, drawn, thresholds);
  return thresholds;
}

namespace {

/// Whatever the thresholds: the leak is in parts of these.
PixelLeak draw_leak(CounterRandom random, std::size_t pixel) {
  const CounterRandom leak = random.keyed("leak");
  const double phase = leak.keyed("phase").uniform(pixel);
  return {static_cast<float>(own_rate(1, leak, pixel)),
          std::min(static_cast<float>(phase), std::nextafter(1.0f, 0.0f))};
}

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

bool comes_before(const Event& left, const Event& right) {
  return std::tie(left.t_s, left.y, left.x, left.positive) <
         std::tie(right.t_s, right.y, right.x, right.positive);
}

namespace {

CounterRandom positive_random(CounterRandom random) { return random.keyed("positive threshold"); }
CounterRandom negative_random(CounterRandom random) { return random.keyed("negative threshold"); }
CounterRandom noise_random(CounterRandom random) { return random.keyed("noise"); }

/// The time from one image to the next. Times within are parts of it, 0..1, so that neither a
/// recording's absolute time nor a tiny step costs precision.
struct Step {
  Step(double from_s, double to_s, const SensorSpec& spec)
      : start_s(from_s),
        end_s(to_s),
        duration_s(to_s - from_s),
        earliest_s(std::nextafter(from_s, to_s)),
        leak(spec.leak_rate_hz * duration_s),
        refractory_s(spec.refractory_s),
        refractory(spec.refractory_s / duration_s) {}

  double start_s;
  double end_s;
  double duration_s;
  double earliest_s;  ///< smallest time after start_s: events lie in (start_s, end_s]
  double leak;        ///< in positive thresholds
  double refractory_s;
  double refractory;  ///< as part of the step
};

[[noreturn]] void refuse_time(double t_s, double before_s) {
  throw std::invalid_argument("expected a time after " + std::to_string(before_s) + " s, got " +
                              std::to_string(t_s) + " s");
}

struct Pixel {
  std::size_t number;
  int x;
  int y;
  double positive_threshold;
  double negative_threshold;
  PixelLeak leak;
};

/// What a pixel sees during a step: its log intensity moves on a line.
struct Light {
  float log_before;
  float log_after;
  float epsilon;

  float log_change() const { return log_after - log_before; }
  /// The linear intensity, at a part of the step.
  double at(double part) const { return std::exp(log_before + log_change() * part) - epsilon; }
};

double next_noise_s(const PixelNoise* noise, std::size_t pixel) {
  return noise ? noise->next_s(pixel) : std::numeric_limits<double>::infinity();
}

void run_eventful_pixel(const Pixel& pixel, const Light& light, double change, const Step& step,
                        PixelNoise* noise, PixelState& state, std::vector<Event>& events);

/// Takes a pixel through a step.
inline void run_pixel(const Pixel& pixel, const Light& light, const Step& step, PixelNoise* noise,
                      PixelState& state, std::vector<Event>& events) {
  const double change = light.log_change() + step.leak * pixel.leak.rate * pixel.positive_threshold;
  // Most pixels: a line between the thresholds at both ends crosses neither.
  const double end = state.difference + change;
  if (end < pixel.positive_threshold && end > -pixel.negative_threshold &&
      next_noise_s(noise, pixel.number) > step.end_s && state.held_until_s <= step.start_s) {
    state.difference = end;
  } else {
    run_eventful_pixel(pixel, light, change, step, noise, state, events);
  }
}

void run_eventful_pixel(const Pixel& pixel, const Light& light, double change, const Step& step,
                        PixelNoise* noise, PixelState& state, std::vector<Event>& events) {
  const double positive = pixel.positive_threshold;
  const double negative = pixel.negative_threshold;
  // d is known at `now`: the step's start, the last reset, or the end of a refractory time.
  double now = state.held_until_s > step.start_s
                   ? (state.held_until_s - step.start_s) / step.duration_s
                   : 0.0;
  double difference = state.difference;
  for (;;) {
    const double crossing = now + until_crossing(difference, change, positive, negative);
    const double noise_at = noise ? (noise->next_s(pixel.number) - step.start_s) / step.duration_s
                                  : std::numeric_limits<double>::infinity();
    if (std::min(crossing, noise_at) > 1) break;
    bool is_positive = change > 0;
    if (noise_at <= crossing) {
      const bool held = noise->next_s(pixel.number) < state.held_until_s;
      const std::optional<bool> taken = noise->take(pixel.number, light.at(noise_at));
      if (held || !taken) continue;
      is_positive = *taken;
    }
    const double event = std::min(crossing, noise_at);
    const double event_s = step.start_s + event * step.duration_s;
    events.push_back({.x = pixel.x,
                      .y = pixel.y,
                      .t_s = std::clamp(event_s, step.earliest_s, step.end_s),
                      .positive = is_positive});
    difference = 0;
    now = event + step.refractory;
    state.held_until_s = event_s + step.refractory_s;
  }
  state.difference = difference + change * std::max(1 - now, 0.0);
}

}  // namespace

Sensor::Sensor(const SensorSpec& spec, ImageSize size, CounterRandom random)
    : spec_(spec),
      size_(size),
      random_(random),
      positive_threshold_(draw_thresholds(spec.positive_threshold, spec.threshold_spread,
                                          size.pixel_count(), positive_random(random))),
      negative_threshold_(draw_thresholds(spec.negative_threshold, spec.threshold_spread,
                                          size.pixel_count(), negative_random(random))) {
  if (!(spec.leak_rate_hz > 0)) return;
  for (std::size_t pixel = 0; pixel < size.pixel_count(); ++pixel) {
    leak_.push_back(draw_leak(random, pixel));
  }
}

std::vector<Event> Sensor::step(std::span<const float> intensity, double t_s) {
  check(intensity, t_s);
  if (!noise_) {
    start(intensity, t_s);
    return {};
  }
  const Step step(time_s_, t_s, spec_);
  const auto epsilon = static_cast<float>(spec_.log_epsilon);
  std::vector<Event> events;
  std::size_t number = 0;
  for (int y = 0; y < size_.height; ++y) {
    for (int x = 0; x < size_.width; ++x, ++number) {
      const float after = std::log(intensity[number] + epsilon);
      const Light light{log_intensity_[number], after, epsilon};
      log_intensity_[number] = after;
      run_pixel({number, x, y, positive_threshold_[number], negative_threshold_[number],
                 leak_.empty() ? PixelLeak() : leak_[number]},
                light, step, &*noise_, pixels_[number], events);
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
  if (!std::isfinite(t_s) || (noise_ && !(t_s > time_s_))) refuse_time(t_s, time_s_);
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
  pixels_.assign(intensity.size(), {.difference = 0, .held_until_s = t_s});
  for (std::size_t i = 0; i < leak_.size(); ++i) {
    pixels_[i].difference = double{leak_[i].phase} * positive_threshold_[i];
  }
  noise_.emplace(spec_, intensity.size(), t_s, noise_random(random_));
  time_s_ = t_s;
}

namespace {

EVENTGAN_CLONES void first_bytes(const CounterRandom& random, std::size_t first_pixel,
                                 std::span<std::uint8_t> bytes) {
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::uint8_t>(random.bits(2 * (first_pixel + i)) >> 56);
  }
}

EVENTGAN_CLONES void widen(std::span<const float> values, std::span<float> lowest,
                           std::span<float> highest) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    lowest[i] = std::min(lowest[i], values[i]);
    highest[i] = std::max(highest[i], values[i]);
  }
}

EVENTGAN_CLONES void widen(std::span<const std::uint8_t> levels, std::span<std::uint8_t> lowest,
                           std::span<std::uint8_t> highest) {
  for (std::size_t i = 0; i < levels.size(); ++i) {
    lowest[i] = std::min(lowest[i], levels[i]);
    highest[i] = std::max(highest[i], levels[i]);
  }
}

/// What the pixels of a row see, image by image.
class SeenRow {
 public:
  virtual ~SeenRow() = default;

  virtual void go_to(int y) = 0;

  /// The light that each pixel sees first, least, and most.
  virtual void range(std::span<float> first, std::span<float> lowest, std::span<float> highest) = 0;

  /// A pixel's log intensity, by image.
  virtual void look(std::size_t x, std::span<float> logs) const = 0;
};

/// Of images that are drawn row by row.
class DrawnRow final : public SeenRow {
 public:
  DrawnRow(const IntensityRow& images, std::size_t count, std::size_t width, float epsilon)
      : images_(images), width_(width), epsilon_(epsilon), light_(count * width) {}

  void go_to(int y) override {
    for (std::size_t i = 0; i * width_ < light_.size(); ++i) {
      images_(i, y, std::span(light_).subspan(i * width_, width_));
    }
  }

  void range(std::span<float> first, std::span<float> lowest, std::span<float> highest) override {
    for (const auto& light : {first, lowest, highest}) {
      std::copy_n(light_.begin(), width_, light.begin());
    }
    for (std::size_t i = width_; i < light_.size(); i += width_) {
      widen(std::span(light_).subspan(i, width_), lowest, highest);
    }
  }

  void look(std::size_t x, std::span<float> logs) const override {
    for (std::size_t k = 0; k < logs.size(); ++k) {
      logs[k] = std::log(light_[k * width_ + x] + epsilon_);
    }
  }

 private:
  const IntensityRow& images_;
  std::size_t width_;
  float epsilon_;
  std::vector<float> light_;  ///< [image, x]
};

/// Of images of grey levels.
class GreyRow final : public SeenRow {
 public:
  GreyRow(std::span<const GreyImage> images, std::size_t width, float epsilon)
      : images_(images), lowest_(width), highest_(width) {
    for (std::size_t level = 0; level < light_.size(); ++level) {
      light_[level] = static_cast<float>(level) / 255.0f;
      logs_[level] = std::log(light_[level] + epsilon);
    }
  }

  void go_to(int y) override { start_ = static_cast<std::size_t>(y) * lowest_.size(); }

  void range(std::span<float> first, std::span<float> lowest, std::span<float> highest) override {
    const auto row = [&](const GreyImage& image) {
      return std::span(image.pixels).subspan(start_, lowest_.size());
    };
    std::ranges::copy(row(images_[0]), lowest_.begin());
    highest_ = lowest_;
    for (const GreyImage& image : images_.subspan(1)) widen(row(image), lowest_, highest_);
    for (std::size_t x = 0; x < lowest_.size(); ++x) {
      first[x] = light_[images_[0].pixels[start_ + x]];
      lowest[x] = light_[lowest_[x]];
      highest[x] = light_[highest_[x]];
    }
  }

  void look(std::size_t x, std::span<float> logs) const override {
    for (std::size_t k = 0; k < logs.size(); ++k) logs[k] = logs_[images_[k].pixels[start_ + x]];
  }

 private:
  std::span<const GreyImage> images_;
  std::array<float, 256> light_;  ///< by level
  std::array<float, 256> logs_;
  std::size_t start_ = 0;
  std::vector<std::uint8_t> lowest_;
  std::vector<std::uint8_t> highest_;
};

/// The least or greatest light that pixels see, and the ratio to the first that it must reach.
struct Extreme {
  std::span<const float> light;
  std::span<const float> ratio;
};

/// Whether pixels that first saw `first` may have an event.
EVENTGAN_CLONES void compare(std::span<const float> first, float epsilon, Extreme lowest,
                             Extreme highest, std::span<std::uint8_t> may) {
  for (std::size_t i = 0; i < first.size(); ++i) {
    const float seen = first[i] + epsilon;
    const bool rises = highest.light[i] + epsilon > seen * highest.ratio[i];
    const bool falls = seen > (lowest.light[i] + epsilon) * lowest.ratio[i];
    may[i] = static_cast<std::uint8_t>(rises | falls);
  }
}

/// The thresholds of one polarity, of which few are drawn: the first byte of the number that gives
/// a Gaussian's radius says already what a pixel's threshold is at least.
class ThresholdDraws {
 public:
  /// `error`: how far a change of the logarithm may be from that of the intensity.
  ThresholdDraws(double mean, double spread, double error, CounterRandom random)
      : mean_(mean), spread_(spread), random_(random) {
    for (std::size_t byte = 0; byte < ratios_.size(); ++byte) {
      const double radius =
          gaussian_radius(static_cast<double>(byte + 1) / static_cast<double>(ratios_.size()));
      const double least = spread > 0 ? mean - spread * radius : mean;
      ratios_[byte] =
          static_cast<float>(std::exp(std::max(least, double{kSmallestThreshold}) - error));
    }
  }

  /// What the light of a pixel and the next ones must be multiplied or divided by, at least, for an
  /// event.
  void least_ratios(std::size_t first_pixel, std::span<float> ratios) {
    bytes_.resize(ratios.size());
    first_bytes(random_, first_pixel, bytes_);
    for (std::size_t i = 0; i < ratios.size(); ++i) ratios[i] = ratios_[bytes_[i]];
  }

  void draw(std::span<const std::size_t> pixels, std::vector<float>& thresholds) {
    thresholds.resize(pixels.size());
    draw_thresholds_of(pixels, mean_, spread_, random_, gaussians_, thresholds);
  }

 private:
  double mean_;
  double spread_;
  CounterRandom random_;
  std::array<float, 256> ratios_;
  std::vector<std::uint8_t> bytes_;
  std::vector<double> gaussians_;
};

/// Takes the pixels of a row at a time through all images.
class RowRuns {
 public:
  RowRuns(const SensorSpec& spec, ImageSize size, std::span<const double> times_s,
          CounterRandom random)
      : width_(static_cast<std::size_t>(size.width)),
        epsilon_(static_cast<float>(spec.log_epsilon)),
        positive_(spec.positive_threshold, spec.threshold_spread, log_error(times_s.size()),
                  positive_random(random)),
        negative_(spec.negative_threshold, spec.threshold_spread, log_error(times_s.size()),
                  negative_random(random)),
        random_(random),
        leaks_(spec.leak_rate_hz > 0),
        start_s_(times_s.front()),
        logs_(times_s.size()) {
    for (std::size_t i = 1; i < times_s.size(); ++i) {
      steps_.emplace_back(times_s[i - 1], times_s[i], spec);
    }
    if (PixelNoise::any(spec)) {
      noise_.emplace(spec, size.pixel_count(), start_s_, noise_random(random));
    }
    only_light_ = !noise_ && !leaks_;
  }

  void run(SeenRow& seen, int y, std::vector<Event>& events) {
    const std::size_t row = static_cast<std::size_t>(y) * width_;
    seen.go_to(y);
    find_pixels(seen, row);
    positive_.draw(pixels_, positive_thresholds_);
    negative_.draw(pixels_, negative_thresholds_);
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const std::size_t x = pixels_[i] - row;
      const Pixel pixel{pixels_[i],
                        static_cast<int>(x),
                        y,
                        positive_thresholds_[i],
                        negative_thresholds_[i],
                        leaks_ ? draw_leak(random_, pixels_[i]) : PixelLeak()};
      seen.look(x, logs_);
      PixelState state{.difference = pixel.leak.phase * pixel.positive_threshold,
                       .held_until_s = start_s_};
      for (std::size_t k = 0; k < steps_.size(); ++k) {
        const Light light{logs_[k], logs_[k + 1], epsilon_};
        run_pixel(pixel, light, steps_[k], noise_ ? &*noise_ : nullptr, state, events);
      }
    }
  }

 private:
  /// A float32 logarithm is good to a millionth, and so is each change from image to image.
  static double log_error(std::size_t images) { return 1e-5 * static_cast<double>(images); }

  /// Those that may have an event, of a row whose first pixel has the number `row`.
  void find_pixels(SeenRow& seen, std::size_t row) {
    may_.assign(width_, true);
    if (only_light_) {
      for (auto* values : {&first_, &lowest_, &highest_, &rise_, &fall_}) values->resize(width_);
      positive_.least_ratios(row, rise_);
      negative_.least_ratios(row, fall_);
      seen.range(first_, lowest_, highest_);
      compare(first_, epsilon_, {lowest_, fall_}, {highest_, rise_}, may_);
    }
    pixels_.resize(width_);
    std::size_t count = 0;
    for (std::size_t x = 0; x < width_; ++x) {
      pixels_[count] = row + x;
      count += may_[x];
    }
    pixels_.resize(count);
  }

  std::size_t width_;
  float epsilon_;
  ThresholdDraws positive_;
  ThresholdDraws negative_;
  CounterRandom random_;
  bool leaks_;
  double start_s_;
  std::vector<Step> steps_;
  std::optional<PixelNoise> noise_;
  bool only_light_;  ///< neither noise nor leak: only changes of intensity give events

  // Of the row at hand.
  std::vector<float> first_;
  std::vector<float> lowest_;
  std::vector<float> highest_;
  std::vector<float> rise_;
  std::vector<float> fall_;
  std::vector<std::uint8_t> may_;
  std::vector<std::size_t> pixels_;
  std::vector<float> positive_thresholds_;
  std::vector<float> negative_thresholds_;
  std::vector<float> logs_;  ///< of a pixel, by image
};

std::vector<Event> events_of(SeenRow& seen, const SensorSpec& spec, ImageSize size,
                             std::span<const double> times_s, const CounterRandom& random) {
  double before_s = std::numeric_limits<double>::lowest();
  for (const double t_s : times_s) {
    if (!std::isfinite(t_s) || !(t_s > before_s)) refuse_time(t_s, before_s);
    before_s = t_s;
  }
  RowRuns runs(spec, size, times_s, random);
  std::vector<Event> events;
  events.reserve(size.pixel_count());
  for (int y = 0; y < size.height; ++y) runs.run(seen, y, events);
  return events;
}

}  // namespace

std::vector<Event> pixel_events(const SensorSpec& spec, ImageSize size, const IntensityRow& images,
                                std::span<const double> times_s, CounterRandom random) {
  DrawnRow seen(images, times_s.size(), static_cast<std::size_t>(size.width),
                static_cast<float>(spec.log_epsilon));
  return events_of(seen, spec, size, times_s, random);
}

std::vector<Event> pixel_events(const SensorSpec& spec, std::span<const GreyImage> images,
                                std::span<const double> times_s, CounterRandom random) {
  const ImageSize size = images[0].size;
  GreyRow seen(images, static_cast<std::size_t>(size.width), static_cast<float>(spec.log_epsilon));
  return events_of(seen, spec, size, times_s, random);
}

}  // namespace eventgan
