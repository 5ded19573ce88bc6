#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "manifests/counter_random.h"
#include "manifests/sensor_spec.h"

namespace eventgan {

/// Noise events of a sensor's pixels: a Poisson process a pixel, of rate shot_noise_rate_hz plus,
/// on a hot pixel, hot_pixel_rate_hz. Times between arrivals are drawn from the exponential
/// distribution by its inverse, so they do not depend on how time is cut into steps.
/// Not thread safe.
class PixelNoise {
 public:
  /// No arrivals before start_s.
  PixelNoise(const SensorSpec& spec, std::size_t pixel_count, double start_s, CounterRandom random);

  /// Time of the pixel's next arrival; infinity where its rate is 0.
  double next_s(std::size_t pixel) const { return next_s_[pixel]; }

  /// Takes the pixel's next arrival and draws the one after it. Returns whether its event is
  /// positive: either for shot noise, always the same for what makes a pixel hot.
  bool take(std::size_t pixel);

 private:
  double rate_hz(std::size_t pixel) const;
  void draw_wait(std::size_t pixel);

  double shot_rate_hz_;
  double hot_rate_hz_;
  CounterRandom wait_random_;
  CounterRandom kind_random_;
  std::vector<double> next_s_;
  std::vector<std::uint64_t> draws_;  ///< arrivals drawn so far
  std::vector<std::int8_t> hot_;      ///< 0 = no, else the polarity of its events: -1, +1
};

}  // namespace eventgan
