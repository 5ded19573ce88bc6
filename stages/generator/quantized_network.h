#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "stages/generator/calibration.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// How a tensor is stored: stored = clamp(round to nearest even(real / scale), 0, 255), so
/// real ≈ scale * stored. No zero point: what is negative becomes 0, which the weights below make
/// up for.
struct TensorQuantization {
  float scale = 0;          ///< > 0
  std::vector<float> mean;  ///< [channel] what the stored tensor is on average, in real units
};

/// The network for an 8-bit engine. Its numbers are still float32, since an engine may form other
/// kernels from them (phases) before quantize_kernel.
///
/// The engine computes, for every convolution except `head` and `pred`, from stored tensors:
///   real = Σ over inputs ( kernel.scales[o] * (Σ stored * kernel.values) ) + bias'[o]
///   bias' = bias + Σ over inputs kernel.bias_correction
/// exact sums in int32 (quantize_kernel sees that they fit), the rest float32; a decoder has two
/// inputs with two scales, hence two kernels (input channels 0 .. 2n-1 the upsampled tensor, 2n ..
/// 3n-1 the skip, n = out_channels); then the addend (its real value: scale * stored) if any, the
/// activation, and storage with the tensor's scale. Behind storage a LeakyReLU and a ReLU are the
/// same. `head` reads float32 frames and `pred` the float32 decoders.3 behind its LeakyReLU of
/// 0.01; both are float32 convolutions.
struct QuantizableNetwork {
  std::vector<Convolution> convolutions;              ///< in the order of network_layout()
  std::map<std::string, TensorQuantization> tensors;  ///< by the names of quantized_tensors()
};

/// Prepares weights for 8 bits. Two changes that cost nothing at run time:
///  - channels of a tensor are scaled to more equal ranges in its producer and back in its uses
///    (exact in real arithmetic: the activations are positively homogeneous; tensors joined by an
///    addition share their factors; Nagel et al., "Data-free quantization through weight
///    equalization and bias correction", 2019, but from activations' ranges);
///  - the negative part that storage loses is guessed from what is kept (TensorStatistics::mixing)
///    and added by the uses' weights and biases. At the image's edge the bias also adds the
///    offset of the zero padding, which has none; the residual additions do without the guess.
/// Pure. Throws as check_weights and check_calibration do.
QuantizableNetwork quantize_network(const Weights& weights, const Calibration& calibration);

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
