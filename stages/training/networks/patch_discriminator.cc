#include "stages/training/networks/detail/patch_discriminator.h"

#include <torch/nn/modules/activation.h>
#include <torch/nn/modules/conv.h>

namespace eventgan {
namespace {

/// The published keys are disc.model.N.
class PatchDiscriminatorShell : public torch::nn::Module {
 public:
  explicit PatchDiscriminatorShell(const torch::nn::Sequential& layers) {
    register_module("model", layers);
  }
};

}  // namespace

PatchDiscriminatorImpl::PatchDiscriminatorImpl(int volume_channels, int image_channels,
                                               int base_channels) {
  const auto add = [&](int in_channels, int out_channels, int stride) {
    layers_->push_back(torch::nn::Conv2d(
        torch::nn::Conv2dOptions(in_channels, out_channels, 4).stride(stride).padding(1)));
  };
  const auto activate = [&] {
    layers_->push_back(
        torch::nn::LeakyReLU(torch::nn::LeakyReLUOptions().negative_slope(0.2).inplace(true)));
  };
  int channels = volume_channels + image_channels;
  for (const int factor : {1, 2, 4, 8}) {
    add(channels, factor * base_channels, 2);
    activate();
    channels = factor * base_channels;
  }
  add(channels, channels, 1);
  activate();
  add(channels, 1, 1);
  register_module("disc", std::make_shared<PatchDiscriminatorShell>(layers_));
}

at::Tensor PatchDiscriminatorImpl::forward(const at::Tensor& volume, const at::Tensor& images) {
  return layers_->forward(at::cat({volume, images}, 1));
}

}  // namespace eventgan
