#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/container/any.h>
#include <torch/nn/modules/container/modulelist.h>
#include <torch/nn/pimpl.h>

#include <vector>

#include "manifests/values/training.h"

namespace eventgan {

struct UNetSettings {
  int in_channels = 2;
  int out_channels = 18;
  int base_channels = 32;
  /// Cycle networks: a tanh prediction after each decoder, concatenated to its features.
  bool multi_scale = false;
  SpectralNormPlace spectral_norm = SpectralNormPlace::kNone;
  double difference_gain = 0;  ///< as NetworkSpec says, of a network of frames
};

/// The U-Net of generator and cycle networks as it is trained: batch norm and
/// spectral norm are not folded, and parameters and buffers have the published names. kDecoders
/// puts spectral norm on residual blocks and decoders, as the published code does.
class UNetImpl : public torch::nn::Module {
 public:
  explicit UNetImpl(const UNetSettings& settings);

  /// [B, in, H, W] float32 → one [B, out, H, W] ≥ 0 (ReLU; in training mode, where gradients are
  /// computed, with the output slope below zero), or, multi-scale, four [B, out, h, w] in
  /// -1..1 (tanh), coarse to fine: h = H/8, H/4, H/2, H, rounded up. Any H, W. Changes batch norm's
  /// statistics in training mode and spectral norm's vectors always.
  std::vector<at::Tensor> forward(const at::Tensor& input);

  /// Of an output that is not multi-scale, below zero, while it learns; 0 at first.
  void set_output_slope(double slope);

 private:
  torch::nn::ModuleList encoders_, resblocks_, decoders_, pred_layers_;
  torch::nn::AnyModule head_, pred_;
  double difference_gain_;
};
TORCH_MODULE(UNet);

}  // namespace eventgan
