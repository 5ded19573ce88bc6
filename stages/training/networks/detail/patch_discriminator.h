#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/pimpl.h>

namespace eventgan {

/// The PatchGAN discriminator of the published code: six 4x4 convolutions with bias, padding 1,
/// strides 2, 2, 2, 2, 1, 1, widths base · (1, 2, 4, 8, 8) → 1, LeakyReLU 0.2 between them. Each
/// logit judges a patch of 142x142 pixels. Images need sides of at least smallest_side().
class PatchDiscriminatorImpl : public torch::nn::Module {
 public:
  PatchDiscriminatorImpl(int volume_channels, int image_channels, int base_channels);

  /// volume [B, volume channels, H, W], images [B, image channels, H, W], float32 → logits
  /// [B, 1, ⌊H/16⌋ - 2, ⌊W/16⌋ - 2]; above 0: taken for real.
  at::Tensor forward(const at::Tensor& volume, const at::Tensor& images);

  /// Pixels a side for one logit.
  static constexpr int smallest_side() { return 48; }

 private:
  torch::nn::Sequential layers_;
};
TORCH_MODULE(PatchDiscriminator);

}  // namespace eventgan
