#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"

namespace eventgan {

/// Standard deviation of the logarithm of a pixel's own rate of leak or shot noise, whose mean over
/// the pixels is the sensor's: real sensors show a factor of 1.7 to 1.9.
inline constexpr double kNoiseRateSpread = 0.5878;  // ln 1.8

/// A pixel's own rate: log-normal of this mean. Thread safe.
double own_rate(double mean, const CounterRandom& random, std::size_t pixel);

/// Share of the shot noise of black that is left at white; in between on a line of the intensity,
/// as v2e has it (generate_shot_noise).
inline constexpr double kShotNoiseAtWhite = 0.25;

/// Noise events of a sensor's pixels: a Poisson process a pixel, of its own rate (log-normal of
/// mean shot_noise_rate_hz, which is that of black) plus, on a hot pixel, hot_pixel_rate_hz. Times
/// between arrivals are drawn from the exponential distribution by its inverse, so they do not
/// depend on how time is cut into steps. Not thread safe.
class PixelNoise {
 public:
  /// No arrivals before start_s.
  PixelNoise(const SensorSpec& spec, std::size_t pixel_count, double start_s, CounterRandom random);

  /// Whether any pixel's rate is above 0.
  static bool any(const SensorSpec& spec);

  /// Time of the pixel's next arrival; infinity where its rate is 0.
  double next_s(std::size_t pixel) const { return next_s_[pixel]; }

  /// Takes the pixel's next arrival, at which it sees `light` (linear, 0..1), and draws the one
  /// after it. Returns whether its event is positive: either for shot noise, always the same for
  /// what makes a pixel hot; none if it is one of the dark alone.
  std::optional<bool> take(std::size_t pixel, double light);

 private:
  double rate_hz(std::size_t pixel) const;
  void draw_wait(std::size_t pixel);

  std::vector<float> shot_rate_hz_;
  double hot_rate_hz_;
  CounterRandom wait_random_;
  CounterRandom kind_random_;
  std::vector<double> next_s_;
  std::vector<std::uint64_t> draws_;  ///< arrivals drawn so far
  std::vector<std::int8_t> hot_;      ///< 0 = no, else the polarity of its events: -1, +1
};

}  // namespace eventgan
