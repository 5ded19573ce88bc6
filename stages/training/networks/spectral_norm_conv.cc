#include "stages/training/networks/detail/spectral_norm_conv.h"

#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>

namespace eventgan {
namespace {

at::Tensor unit_vector(const at::Tensor& vector) { return vector / (vector.norm() + 1e-12); }

}  // namespace

/// The tensors, apart, because the published keys have them in a module of their own.
class SpectralNormConvImpl::Weight : public torch::nn::Module {
 public:
  Weight(std::int64_t out_channels, std::int64_t in_channels, std::int64_t height,
         std::int64_t width)
      : bar(register_parameter("weight_bar",
                               torch::zeros({out_channels, in_channels, height, width}))),
        u(register_buffer("weight_u", torch::zeros({out_channels}))),
        v(register_buffer("weight_v", torch::zeros({in_channels * height * width}))) {}

  at::Tensor bar;
  at::Tensor u;
  at::Tensor v;
};

SpectralNormConvImpl::SpectralNormConvImpl(const torch::nn::Conv2dOptions& options)
    : options_(options),
      weight_(register_module(
          "module",
          std::make_shared<Weight>(options.out_channels(), options.in_channels(),
                                   options.kernel_size()->at(0), options.kernel_size()->at(1)))) {}

at::Tensor SpectralNormConvImpl::normalized_weight() {
  const at::Tensor matrix = weight_->bar.flatten(1);
  at::Tensor u, v;
  {
    const at::NoGradGuard constants;
    v = unit_vector(at::mv(matrix.t(), weight_->u));
    u = unit_vector(at::mv(matrix, v));
    // The buffers get copies: a later forward must not change what this one's backward reads.
    weight_->v.copy_(v);
    weight_->u.copy_(u);
  }
  return weight_->bar / at::dot(u, at::mv(matrix, v));
}

at::Tensor SpectralNormConvImpl::forward(const at::Tensor& input) {
  // LibTorch 1's own variant, or later the standard library's: each brings its `get`.
  const auto& padding = get<torch::ExpandingArray<2>>(options_.padding());
  return at::conv2d(input, normalized_weight(), {}, options_.stride(), *padding);
}

}  // namespace eventgan
