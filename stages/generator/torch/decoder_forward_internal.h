#pragma once

#include <ATen/core/Tensor.h>

#include "stages/generator/weights.h"

namespace eventgan {

/// One decoder's convolution over [nearest-doubled x, skip connection] without its activation, the
/// doubling done by phases (decoder_kernels.h). Thread safe.
class DecoderForward {
 public:
  /// `type`: at::kFloat or at::kBFloat16.
  DecoderForward(const Convolution& decoder, at::ScalarType type);

  /// x: [1, channels, (H + 1) / 2, (W + 1) / 2]; skip: [1, out, H, W]; returned [1, out, H, W]; all
  /// channels-last.
  at::Tensor operator()(const at::Tensor& x, const at::Tensor& skip) const;

 private:
  void add_phases(const at::Tensor& x, at::Tensor& sum) const;
  void add_last_row(const at::Tensor& x, at::Tensor& sum) const;
  void add_last_column(const at::Tensor& x, at::Tensor& sum) const;

  at::Tensor skip_;
  at::Tensor bias_;
  at::Tensor phases_;
  at::Tensor doubled_;
};

/// [out, in, side, side] float32, C order, as a channels-last tensor of that type.
at::Tensor kernel_tensor(const std::vector<float>& kernel, int out_channels, int in_channels,
                         int side, at::ScalarType type);

/// [count] float32.
at::Tensor bias_tensor(const std::vector<float>& bias, at::ScalarType type);

}  // namespace eventgan
