#include <torch/nn/modules/conv.h>

#include "stages/training/networks/spectral_norm_conv_internal.h"
#include "stages/training/networks/unet_layers_internal.h"

namespace eventgan {
namespace {

constexpr double kLeakySlope = 0.01;

/// In place where the layer before does not need its output for the gradient: memory and time.
at::Tensor activate(at::Tensor x, Activation activation) {
  switch (activation) {
    case Activation::kRelu:
      return at::relu_(x);
    case Activation::kTanh:
      return at::tanh(x);
    case Activation::kLeakyRelu:
      break;
  }
  return at::leaky_relu_(x, kLeakySlope);
}

}  // namespace

torch::nn::AnyModule make_convolution(const torch::nn::Conv2dOptions& options, bool spectral_norm) {
  if (spectral_norm) return torch::nn::AnyModule(SpectralNormConv(options));
  return torch::nn::AnyModule(torch::nn::Conv2d(options));
}

ConvLayerImpl::ConvLayerImpl(const ConvLayerSettings& settings)
    : convolution_(make_convolution(
          torch::nn::Conv2dOptions(settings.in_channels, settings.out_channels, settings.kernel)
              .stride(settings.stride)
              .padding((settings.kernel - 1) / 2)
              .bias(!settings.batch_norm),
          settings.spectral_norm)),
      activation_(settings.activation) {
  register_module("conv2d", convolution_.ptr());
  if (settings.batch_norm) {
    norm_ = register_module(
        "norm_layer", torch::nn::BatchNorm2d(
                          torch::nn::BatchNorm2dOptions(settings.out_channels).momentum(0.01)));
  }
}

at::Tensor ConvLayerImpl::forward(const at::Tensor& input) {
  at::Tensor x = convolution_.forward(input);
  if (norm_) x = norm_->forward(x);
  return activate(x, activation_);
}

ResidualBlockImpl::ResidualBlockImpl(int channels, bool spectral_norm) {
  const auto options = torch::nn::Conv2dOptions(channels, channels, 3).padding(1).bias(false);
  convolution1_ = make_convolution(options, spectral_norm);
  convolution2_ = make_convolution(options, spectral_norm);
  register_module("conv1", convolution1_.ptr());
  register_module("conv2", convolution2_.ptr());
  norm1_ = register_module("bn1", torch::nn::BatchNorm2d(channels));
  norm2_ = register_module("bn2", torch::nn::BatchNorm2d(channels));
}

at::Tensor ResidualBlockImpl::forward(const at::Tensor& input) {
  at::Tensor x = norm1_->forward(convolution1_.forward(input));
  x = norm2_->forward(convolution2_.forward(at::relu_(x)));
  return at::relu_(x.add_(input));
}

}  // namespace eventgan
