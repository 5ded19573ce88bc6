#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace eventgan {

/// The largest 8-bit weight there is, and the largest with which processors without VNNI are right:
/// their multiply-add sums two products u8 * s8 in 16 bits with saturation, and 2 * 255 * 64 fits.
constexpr int kLargestWeight = 127;
constexpr int kLargestWeightWithoutVnni = 64;

/// The largest stored activation (TensorQuantization).
constexpr int kLargestStored = 255;

/// A kernel in 8 bits: real weight ≈ values * scales[o] / input scale.
struct QuantizedKernel {
  std::vector<std::int8_t> values;     ///< as the float kernel: [out, in, taps], C order
  std::vector<float> scales;           ///< [out] one step of the int32 sum in real units, > 0
  std::vector<float> bias_correction;  ///< [out] to add to the bias: what rounding takes on average
};

/// Quantises a kernel [out, in, taps] float32, C order (any window, for instance a phase of 2x2),
/// per output channel: step = largest |w| of the channel / largest_weight, values = round to
/// nearest even(w / step), scales = step * input_scale. A channel of zeros, or of numbers so small
/// that its scale would not be a normal float, has zeros and a scale of input_scale.
/// bias_correction[o] = Σ_in,taps (w - step * value) * input_mean[in].
/// input_scale and input_mean [in] are the input tensor's TensorQuantization. largest_weight in
/// 1..127. Throws std::invalid_argument if sizes disagree, numbers are not finite, or the sum of a
/// row's products with values of 0..255 may leave 32 bits. Pure.
QuantizedKernel quantize_kernel(std::span<const float> kernel, int out_channels, float input_scale,
                                std::span<const float> input_mean,
                                int largest_weight = kLargestWeight);

}  // namespace eventgan
