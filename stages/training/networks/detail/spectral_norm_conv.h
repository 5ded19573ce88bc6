#pragma once

#include <torch/nn/module.h>
#include <torch/nn/options/conv.h>
#include <torch/nn/pimpl.h>

namespace eventgan {

/// A convolution without bias whose weight is divided by its largest singular value (Miyato et al.
/// 2018, "Spectral Normalization for GANs"), as the published code keeps and computes it:
///
///   W = weight_bar as a matrix [out, in · y · x]
///   v ← Wᵀu / (|Wᵀu| + 1e-12),  u ← W v / (|W v| + 1e-12)   one power iteration
///   σ = uᵀ W v,  weight = weight_bar / σ
///
/// on every forward, also in evaluation. u and v are constants to the gradient; weight_bar is not,
/// in σ as well as above it. Holds the parameter `module.weight_bar` and the buffers
/// `module.weight_u` [out] and `module.weight_v` [in · y · x].
///
/// The tensors hold no numbers until initialize() or load_network(). forward() changes u and v, so
/// one object serves one thread at a time.
class SpectralNormConvImpl : public torch::nn::Module {
 public:
  explicit SpectralNormConvImpl(const torch::nn::Conv2dOptions& options);

  /// [B, in, H, W] → [B, out, H', W'], in the input's dtype or, under autocast, its lower one.
  at::Tensor forward(const at::Tensor& input);

 private:
  class Weight;

  /// weight_bar / σ after one power iteration.
  at::Tensor normalized_weight();

  torch::nn::Conv2dOptions options_;
  std::shared_ptr<Weight> weight_;
};
TORCH_MODULE(SpectralNormConv);

}  // namespace eventgan
