#pragma once

#include <cmath>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"

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

/// An image of one log intensity.
inline std::vector<float> log_image(ImageSize size, double log, const SensorSpec& spec) {
  return std::vector<float>(size.pixel_count(), intensity_at(log, spec));
}

/// A texture known at every place, about [0.1, 0.9]: waves of 9 to 40 px in several directions, so
/// that its images can be moved by any part of a pixel without rounding.
inline double texture(double x, double y) {
  return 0.5 + 0.1 * std::sin(0.16 * x + 0.05 * y) + 0.1 * std::sin(0.31 * y - 0.21 * x + 1) +
         0.1 * std::sin(0.45 * x + 0.38 * y + 2) + 0.1 * std::sin(0.55 * x - 0.43 * y + 3);
}

/// The texture moved by (dx, dy) px, rounded to 8 bits.
inline GreyImage textured_image(ImageSize size, double dx = 0, double dy = 0) {
  GreyImage image{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.pixels.push_back(static_cast<std::uint8_t>(std::lround(255 * texture(x - dx, y - dy))));
    }
  }
  return image;
}

}  // namespace eventgan::testing
