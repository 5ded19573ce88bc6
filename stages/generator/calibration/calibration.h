#pragma once

#include <string>
#include <vector>

namespace eventgan {

/// What real pairs showed of one tensor that an 8-bit engine stores (quantized_tensors.h). x is the
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

}  // namespace eventgan
