#pragma once

#include <span>
#include <string>
#include <vector>

namespace eventgan {

/// Sums over pixels of one tensor, in double. With x the tensor, kept = max(x, 0) and lost =
/// min(x, 0); [channel] or [channel, channel] in C order; `lost` and the pairs of channels only for
/// tensors behind a LeakyReLU, else empty.
struct TensorSums {
  std::string name;               ///< of quantized_tensors()
  double pixels = 0;              ///< how many were summed
  std::vector<double> highest;    ///< largest kept value, no sum
  std::vector<double> kept;       ///< Σ kept
  std::vector<double> lost;       ///< Σ lost
  std::vector<double> kept_kept;  ///< [a, b] Σ kept_a kept_b
  std::vector<double> lost_kept;  ///< [a, b] Σ lost_a kept_b
};

/// What is kept of the calibration's pairs: its size depends on the network alone (7 MB at a base
/// width of 32).
struct CalibrationSums {
  int pairs = 0;
  std::vector<TensorSums> tensors;  ///< in the order of quantized_tensors()
};

/// Sums of no pair for a network of that base width.
CalibrationSums empty_calibration_sums(int base_channels);

/// Adds one pair's tensor, values [pixel, channel] float32. `highest` is over all pixels, the sums
/// over at most 4096 evenly spaced ones. Throws std::invalid_argument if the values are not whole
/// pixels, std::runtime_error if they are not finite.
void add_tensor(TensorSums& sums, std::span<const float> values);

/// Adds the sums of other pairs of the same network. The same sums in the same order give the same
/// result. Throws std::invalid_argument if they are of another base width.
void merge(CalibrationSums& sums, const CalibrationSums& more);

}  // namespace eventgan
