#pragma once

#include <span>
#include <string>
#include <vector>

namespace eventgan {

/// Where a tensor enters a convolution: as its input channels from `first_channel` on.
struct TensorUse {
  std::string convolution;
  int first_channel = 0;
};

/// A tensor of the network that an 8-bit engine stores in 8 bits: what a convolution leaves behind
/// its activation.
struct QuantizedTensor {
  std::string name;      ///< the convolution that makes it, or "resblocks.N" behind the addition
  std::string producer;  ///< the convolution that makes it
  int channels = 0;
  bool leaky = false;  ///< behind a LeakyReLU, so it has small negative values; else a ReLU
  std::string addend;  ///< the tensor that is added before the activation; empty: none
  std::vector<TensorUse> uses;
};

/// The tensors, in the order in which the network makes them; [a, b] are a decoder's two inputs, a
/// upsampled, b the skip, whose channels follow a's:
///
///   head ← the frames, which are float32
///   encoders.0 ← head
///   encoders.1 ← encoders.0
///   encoders.2 ← encoders.1
///   encoders.3 ← encoders.2
///   resblocks.0.conv1 ← encoders.3
///   resblocks.0 ← conv2 of resblocks.0.conv1, plus encoders.3
///   resblocks.1.conv1 ← resblocks.0
///   resblocks.1 ← conv2 of resblocks.1.conv1, plus resblocks.0
///   decoders.0 ← [resblocks.1, encoders.2]
///   decoders.1 ← [decoders.0, encoders.1]
///   decoders.2 ← [decoders.1, encoders.0]
///
/// Float32, and so not among them: decoders.3 ← [decoders.2, head], and pred ← decoders.3.
std::vector<QuantizedTensor> quantized_tensors(int base_channels);

/// What real pairs showed of one tensor that an 8-bit engine stores (quantized_tensors). x is the
/// tensor's real value behind its activation; means are over the pixels of all pairs.
struct TensorStatistics {
  std::string name;            ///< of quantized_tensors()
  std::vector<float> highest;  ///< [channel] largest value, ≥ 0: a channel never above 0 has 0
  std::vector<float> mean;     ///< [channel] mean of max(x, 0)

  /// A tensor behind a LeakyReLU only, else both empty: the least-squares guess of the negative
  /// part, which unsigned storage loses, from the part that is kept:
  ///   min(x_c, 0) ≈ offset_c + Σ_k mixing[c, k] max(x_k, 0)
  std::vector<float> offset;  ///< [channel]
  std::vector<float> mixing;  ///< [channel, channel], C order
};

/// What quantize_network needs to know beyond the weights, found from real pairs by Calibrator.
struct Calibration {
  int pairs = 0;       ///< frame pairs seen, ≥ 1
  std::string origin;  ///< where they come from, for the reader of the weights file
  std::vector<TensorStatistics> tensors;  ///< in the order of quantized_tensors()
};

/// Throws std::runtime_error "expected X, got Y, in NAME" unless the calibration has at least one
/// pair, exactly the tensors and sizes of a network of this base width, and finite numbers.
void check_calibration(const Calibration& calibration, int base_channels, const std::string& name);

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
