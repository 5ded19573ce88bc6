#pragma once

#include <cmath>
#include <span>
#include <vector>

namespace eventgan {

/// How far a sensor's log intensity moves between two events of a pixel: C₊ = C/√ρ for positive
/// events, C₋ = C√ρ for negative ones.
struct ContrastThreshold {
  double mean = 0;   ///< C, the geometric mean of both, > 0
  double ratio = 1;  ///< ρ, of the negative one to the positive one, > 0

  double positive() const { return mean / std::sqrt(ratio); }
  double negative() const { return mean * std::sqrt(ratio); }
  bool operator==(const ContrastThreshold&) const = default;
};

/// Contrast thresholds that something was made for, log units: 0 < lowest ≤ highest.
struct ThresholdRange {
  double lowest = 0;
  double highest = 0;
  bool contains(double threshold) const { return lowest <= threshold && threshold <= highest; }
  /// Of both polarities.
  bool contains(const ContrastThreshold& threshold) const {
    return contains(threshold.positive()) && contains(threshold.negative());
  }
  double geometric_mean() const { return std::sqrt(lowest * highest); }
  bool operator==(const ThresholdRange&) const = default;
};

/// ε of the frames' log intensity ln(u/255 + ε), wherever a contrast threshold is that of frames.
inline constexpr double kFrameLogEpsilon = 0.02;

/// A change by more contrast thresholds counts as this many.
inline constexpr double kMostThresholds = 10;

/// What a network that knows its sensor sees, [plane, y, x] float32, C order, in [-1, 1]: the
/// two frames, and between them the change of log intensity in contrast thresholds C,
///   clamp((L(next) - L(previous)) / C, -m, m) / m,  L = ln(u/255 + ε), u the nearest of 0..255,
/// C = C₊ where it rises and C₋ where it falls, ε = kFrameLogEpsilon, m = kMostThresholds. A pixel
/// that is not a number in either frame is none in the third plane.
///
/// frames: [frame, y, x] float32, previous then next, in [-1, 1]. Thread safe.
std::vector<float> sensor_input(std::span<const float> frames, const ContrastThreshold& threshold);

}  // namespace eventgan
