#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/calibration.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan::testing {

// What the tests of all engines share.

/// Two frames [2, y, x] in [-1, 1] like a photograph: soft shapes and some noise, the second one
/// shifted.
std::vector<float> natural_frames(ImageSize size, std::uint64_t seed);

/// The volume, written over numbers that no generator makes.
std::vector<float> generated(const Generator& generator, const std::vector<float>& frames,
                             ImageSize size);

/// |a - expected| / |expected|, Euclidean; of two sequences of zeros 0.
double relative_error(const std::vector<float>& a, const std::vector<float>& expected);

float largest_difference(const std::vector<float>& a, const std::vector<float>& b);

/// Random weights of a network that knows its sensor, of thresholds 0.1 to 0.4.
Weights untrained_sensor_weights(int base_channels, int bins, std::uint64_t seed);

/// What a network of these weights sees of the frames, told no threshold: network_planes().
std::vector<float> planes_of(const Weights& weights, const std::vector<float>& frames,
                             ImageSize size);

/// The weights with a calibration from a few natural_frames of this size.
Weights calibrated(const Weights& weights, ImageSize size);

/// A calibration of random numbers: ranges over three powers of ten, means below them, small
/// offsets and mixings. The same seed gives the same numbers.
Calibration sample_calibration(int base_channels, std::uint64_t seed);

}  // namespace eventgan::testing
