#pragma once

#include <cmath>
#include <vector>

#include "manifests/image_size.h"
#include "manifests/sensor_spec.h"

namespace eventgan::testing {

/// A sensor without noise whose pixels all have the threshold given.
inline SensorSpec exact_sensor(double threshold) {
  SensorSpec spec;
  spec.positive_threshold = threshold;
  spec.negative_threshold = threshold;
  spec.threshold_spread = 0;
  return spec;
}

/// The intensity whose log intensity, ε included, is `log`.
inline float intensity_at(double log, const SensorSpec& spec) {
  return static_cast<float>(std::exp(log) - spec.log_epsilon);
}

/// A picture of one log intensity.
inline std::vector<float> log_picture(ImageSize size, double log, const SensorSpec& spec) {
  return std::vector<float>(size.pixel_count(), intensity_at(log, spec));
}

}  // namespace eventgan::testing
