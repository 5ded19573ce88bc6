#pragma once

#include <ATen/core/Tensor.h>

#include <map>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// One decoder's convolution over [nearest-doubled x, skip connection] without its activation, the
/// doubling done by sub-pixel phases (decoder_kernels.h). Thread safe.
class DecoderForward {
 public:
  /// `kind`: at::kFloat or at::kBFloat16, and the device.
  DecoderForward(const Convolution& decoder, const at::TensorOptions& kind);

  /// x: [B, channels, (H + 1) / 2, (W + 1) / 2]; skip: [B, out, H, W]; returned [B, out, H, W]; all
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

/// [out, in, side, side] float32, C order, as a channels-last tensor of that type, on that device.
at::Tensor kernel_tensor(const std::vector<float>& kernel, int out_channels, int in_channels,
                         int side, const at::TensorOptions& kind);

/// [count] float32.
at::Tensor bias_tensor(const std::vector<float>& bias, const at::TensorOptions& kind);

/// Lets the calling thread compute with one intra-operation thread from then on. LibTorch keeps its
/// thread count per calling thread, and oneDNN reads OpenMP's; without both, a worker silently
/// takes every core. The last bits of a convolution depend on the count, so it is one, always.
void use_one_thread();

/// The generator's network (weights.h) in LibTorch. Thread safe.
class NetworkForward {
 public:
  /// `kind`: what is computed in, at::kFloat or at::kBFloat16, and the device, else the CPU. Throws
  /// as check_weights; std::runtime_error if LibTorch fails.
  explicit NetworkForward(const Weights& weights, const at::TensorOptions& kind = at::kFloat);

  /// frames: [frame, y, x] float32, C order. Returns [1, 2 bins, H, W] of the type, channels-last.
  /// The calling thread computes with one intra-operation thread from then on. Call under
  /// c10::InferenceMode. Throws c10::Error.
  at::Tensor operator()(std::span<const float> frames, ImageSize size) const;

  /// The same of several pairs [B, 2, H, W] float32, in ordinary memory or on the device: returns
  /// [B, 2 bins, H, W] on the device, where it may still be computed.
  at::Tensor operator()(const at::Tensor& frames) const;

 private:
  struct Layer {
    at::Tensor weight;
    at::Tensor bias;
    int stride = 1;
    int padding = 0;
  };

  at::Tensor convolve(const std::string& name, const at::Tensor& x) const;
  at::Tensor leaky(const std::string& name, const at::Tensor& x) const;
  at::Tensor residual(const std::string& block, const at::Tensor& x) const;

  at::TensorOptions kind_;
  std::map<std::string, Layer> layers_;
  std::vector<DecoderForward> decoders_;
};

}  // namespace eventgan
