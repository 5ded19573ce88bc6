#include "stages/generator/calibration/quantized_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

void check_finite(std::span<const float> values, const char* what) {
  if (std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) return;
  throw std::invalid_argument(std::string("expected finite ") + what + ", got NaN or infinity");
}

float largest_magnitude(std::span<const float> values) {
  float largest = 0;
  for (const float value : values) largest = std::max(largest, std::abs(value));
  return largest;
}

/// What one unit of a row's weights stands for. One so small that the scale would not be a normal
/// float counts as a row of zeros.
double weight_step(float largest, int largest_weight, float input_scale) {
  const double step = double(largest) / largest_weight;
  return step * input_scale < std::numeric_limits<float>::min() ? 1 : step;
}

/// An engine adds up the products of one output with stored values of 0..255 in 32 bits, in any
/// order: no sum of some of them may leave those.
void check_sums(std::span<const std::int8_t> row) {
  std::int64_t positive = 0, negative = 0;
  for (const std::int8_t value : row) (value > 0 ? positive : negative) += value;
  const std::int64_t largest = kLargestStored * std::max(positive, -negative);
  if (largest <= std::numeric_limits<std::int32_t>::max()) return;
  throw std::invalid_argument("expected 8-bit sums of at most 2^31 - 1, got up to " +
                              std::to_string(largest) + " from " + std::to_string(row.size()) +
                              " weights: the network is too wide for int8");
}

void check(std::span<const float> kernel, int out_channels, float input_scale,
           std::span<const float> input_mean, int largest_weight) {
  if (out_channels < 1 || input_mean.empty() || kernel.empty() ||
      kernel.size() % (out_channels * input_mean.size()) != 0) {
    throw std::invalid_argument("expected a kernel [" + std::to_string(out_channels) + ", " +
                                std::to_string(input_mean.size()) + ", taps], got " +
                                std::to_string(kernel.size()) + " values");
  }
  if (!(input_scale > 0) || !std::isfinite(input_scale)) {
    throw std::invalid_argument("expected an input scale above 0, got " +
                                std::to_string(input_scale));
  }
  if (largest_weight < 1 || largest_weight > kLargestWeight) {
    throw std::invalid_argument("expected a largest weight in 1..127, got " +
                                std::to_string(largest_weight));
  }
  check_finite(kernel, "weights");
  check_finite(input_mean, "means");
}

}  // namespace

QuantizedKernel quantize_kernel(std::span<const float> kernel, int out_channels, float input_scale,
                                std::span<const float> input_mean, int largest_weight) {
  check(kernel, out_channels, input_scale, input_mean, largest_weight);
  const std::size_t row_size = kernel.size() / out_channels;
  const std::size_t taps = row_size / input_mean.size();
  QuantizedKernel result;
  result.values.resize(kernel.size());
  for (int out = 0; out < out_channels; ++out) {
    const std::span<const float> row = kernel.subspan(out * row_size, row_size);
    const double step = weight_step(largest_magnitude(row), largest_weight, input_scale);
    double correction = 0;
    for (std::size_t i = 0; i < row_size; ++i) {
      // At most largest_weight, since step is largest / largest_weight.
      const double value = std::nearbyint(row[i] / step);
      result.values[out * row_size + i] = static_cast<std::int8_t>(value);
      correction += (row[i] - step * value) * input_mean[i / taps];
    }
    check_sums(std::span(result.values).subspan(out * row_size, row_size));
    result.scales.push_back(static_cast<float>(step * input_scale));
    result.bias_correction.push_back(static_cast<float>(correction));
  }
  check_finite(result.scales, "scales");
  check_finite(result.bias_correction, "corrections");
  return result;
}

}  // namespace eventgan
