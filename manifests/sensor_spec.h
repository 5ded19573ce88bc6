#pragma once

#include <string>

namespace eventgan {

/// The model of an event camera's pixel that the simulators share: it signals when the logarithm of
/// its intensity has moved by a contrast threshold since its last event (Rebecq et al., ESIM, 2018;
/// noise as in Hu et al., v2e, 2021). Logarithms are natural, of the linear intensity u/255 + ε.
struct SensorSpec {
  double positive_threshold = 0.2;  ///< mean contrast threshold of positive events, 0.01..5
  double negative_threshold = 0.2;  ///< the same of negative events, as a positive number
  double threshold_spread = 0.03;   ///< standard deviation over the pixels, log units, 0..1; drawn
                                    ///< per polarity; a pixel's threshold is never below 0.01
  double refractory_s = 0;          ///< a pixel is silent so long after an event, 0..1; what it
                                    ///< passes by then is lost, its level follows
  double leak_rate_hz = 0;          ///< positive events per pixel and second without any motion
  double shot_noise_rate_hz = 0;    ///< events of either polarity per pixel and second, Poisson;
                                    ///< the rate of one polarity is half of it
  double hot_pixel_fraction = 0;    ///< share of pixels that are hot, 0..1
  double hot_pixel_rate_hz = 0;     ///< events per second of a hot pixel, Poisson, one polarity
  double log_epsilon = 0.001;       ///< ε, 1e-6..1: keeps the logarithm of black finite
  bool operator==(const SensorSpec&) const = default;
};

/// All of it as compact JSON, keys as in the manifests: what reports and recordings say of a
/// sensor.
std::string to_json(const SensorSpec& spec);

}  // namespace eventgan
