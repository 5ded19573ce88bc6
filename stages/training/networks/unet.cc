#include "stages/training/networks/detail/unet.h"

#include <ATen/core/grad_mode.h>
#include <torch/nn/module.h>
#include <torch/nn/modules/batchnorm.h>
#include <torch/nn/modules/container/any.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/options/conv.h>
#include <torch/nn/pimpl.h>

#include "stages/training/networks/detail/spectral_norm_conv.h"

namespace eventgan {
namespace {

enum class LayerActivation { kLeakyRelu, kRelu, kTanh };  ///< leaky: slope 0.01

struct ConvLayerSettings {
  int in_channels = 0;
  int out_channels = 0;
  int kernel = 3;  ///< side in pixels; padding keeps the size at stride 1
  int stride = 1;
  bool batch_norm = false;  ///< then the convolution has no bias
  bool spectral_norm = false;
  LayerActivation activation = LayerActivation::kLeakyRelu;
};

/// `conv2d`, `norm_layer` (momentum 0.01), activation.
class ConvLayerImpl : public torch::nn::Module {
 public:
  explicit ConvLayerImpl(const ConvLayerSettings& settings);
  at::Tensor forward(const at::Tensor& input);
  /// Of kRelu below zero, in training mode where gradients are computed.
  void set_learning_slope(double slope) { learning_slope_ = slope; }

 private:
  torch::nn::AnyModule convolution_;
  torch::nn::BatchNorm2d norm_{nullptr};
  LayerActivation activation_;
  double learning_slope_ = 0;
};
TORCH_MODULE(ConvLayer);

/// relu(x + bn2(conv2(relu(bn1(conv1(x)))))), batch norms of momentum 0.1.
class ResidualBlockImpl : public torch::nn::Module {
 public:
  ResidualBlockImpl(int channels, bool spectral_norm);
  at::Tensor forward(const at::Tensor& input);

 private:
  torch::nn::AnyModule convolution1_, convolution2_;
  torch::nn::BatchNorm2d norm1_{nullptr}, norm2_{nullptr};
};
TORCH_MODULE(ResidualBlock);

constexpr double kLeakySlope = 0.01;

/// In place where the layer before does not need its output for the gradient: memory and time.
at::Tensor activate(at::Tensor x, LayerActivation activation) {
  switch (activation) {
    case LayerActivation::kRelu:
      return at::relu_(x);
    case LayerActivation::kTanh:
      return at::tanh(x);
    case LayerActivation::kLeakyRelu:
      break;
  }
  return at::leaky_relu_(x, kLeakySlope);
}

/// A convolution, plain or spectral-normalised, to be registered under a name of its own: forward
/// takes and gives one tensor.
torch::nn::AnyModule make_convolution(const torch::nn::Conv2dOptions& options, bool spectral_norm) {
  if (spectral_norm) return torch::nn::AnyModule(SpectralNormConv(options));
  return torch::nn::AnyModule(torch::nn::Conv2d(options));
}

}  // namespace

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
  if (learning_slope_ > 0 && is_training() && at::GradMode::is_enabled()) {
    return at::leaky_relu_(x, learning_slope_);
  }
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

namespace {

constexpr int kLevels = 4;
constexpr int kResidualBlocks = 2;

}  // namespace

UNetImpl::UNetImpl(const UNetSettings& settings) : difference_gain_(settings.difference_gain) {
  const int base = settings.base_channels;
  const bool encoder_norm = settings.spectral_norm == SpectralNormPlace::kEncoders;
  const bool decoder_norm = settings.spectral_norm == SpectralNormPlace::kDecoders;
  const auto prediction = [&](int in_channels) {
    return ConvLayer(ConvLayerSettings{
        .in_channels = in_channels,
        .out_channels = settings.out_channels,
        .kernel = 1,
        .activation = settings.multi_scale ? LayerActivation::kTanh : LayerActivation::kRelu});
  };

  const ConvLayer head(
      ConvLayerSettings{.in_channels = settings.in_channels, .out_channels = base});
  head_ = torch::nn::AnyModule(head);
  register_module("head", head);
  for (int level = 0; level < kLevels; ++level) {
    encoders_->push_back(ConvLayer(ConvLayerSettings{.in_channels = base << level,
                                                     .out_channels = base << (level + 1),
                                                     .stride = 2,
                                                     .batch_norm = true,
                                                     .spectral_norm = encoder_norm}));
  }
  for (int block = 0; block < kResidualBlocks; ++block) {
    resblocks_->push_back(ResidualBlock(base << kLevels, decoder_norm));
  }
  for (int level = kLevels - 1; level >= 0; --level) {
    // [upsampled, prediction of the level below if there is one, skip]
    const bool after_prediction = settings.multi_scale && level < kLevels - 1;
    const int out_channels = base << level;
    decoders_->push_back(ConvLayer(ConvLayerSettings{
        .in_channels = 3 * out_channels + (after_prediction ? settings.out_channels : 0),
        .out_channels = out_channels,
        .batch_norm = true,
        .spectral_norm = decoder_norm}));
    if (settings.multi_scale) pred_layers_->push_back(prediction(out_channels));
  }
  register_module("encoders", encoders_);
  register_module("resblocks", resblocks_);
  register_module("decoders", decoders_);
  // Multi-scale networks have a `pred` too that nothing goes through: published checkpoints hold
  // it.
  const ConvLayer pred = prediction(base);
  pred_ = torch::nn::AnyModule(pred);
  register_module("pred", pred);
  if (settings.multi_scale) register_module("pred_layers", pred_layers_);
}

void UNetImpl::set_output_slope(double slope) { pred_.get<ConvLayer>()->set_learning_slope(slope); }

std::vector<at::Tensor> UNetImpl::forward(const at::Tensor& input) {
  at::Tensor x = input;
  if (difference_gain_ > 0) {
    const at::Tensor previous = input.narrow(1, 0, 1), next = input.narrow(1, 1, 1);
    x = at::cat({(previous + next) / 2, difference_gain_ * (next - previous),
                 difference_gain_ * input.narrow(1, 2, input.size(1) - 2)},
                1);
  }
  x = head_.forward(x);
  std::vector<at::Tensor> skips;
  for (const auto& encoder : *encoders_) {
    skips.push_back(x);
    x = encoder->as<ConvLayer>()->forward(x);
  }
  for (const auto& block : *resblocks_) x = block->as<ResidualBlock>()->forward(x);
  std::vector<at::Tensor> predictions;
  for (std::size_t level = 0; level < decoders_->size(); ++level) {
    const at::Tensor skip = std::move(skips.back());
    skips.pop_back();
    std::vector<at::Tensor> parts = {x};
    if (!predictions.empty()) parts.push_back(predictions.back());
    x = at::upsample_nearest2d(at::cat(parts, 1), {skip.size(2), skip.size(3)});
    x = decoders_[level]->as<ConvLayer>()->forward(at::cat({x, skip}, 1));
    if (!pred_layers_->is_empty()) {
      predictions.push_back(pred_layers_[level]->as<ConvLayer>()->forward(x));
    }
  }
  if (predictions.empty()) return {pred_.forward(x)};
  return predictions;
}

}  // namespace eventgan
