#include "stages/training/networks/unet_internal.h"
#include "stages/training/networks/unet_layers_internal.h"

namespace eventgan {
namespace {

constexpr int kLevels = 4;
constexpr int kResidualBlocks = 2;

}  // namespace

UNetImpl::UNetImpl(const UNetSettings& settings) {
  const int base = settings.base_channels;
  const bool encoder_norm = settings.spectral_norm == SpectralNormPlace::kEncoders;
  const bool decoder_norm = settings.spectral_norm == SpectralNormPlace::kDecoders;
  const auto prediction = [&](int in_channels) {
    return ConvLayer(ConvLayerSettings{
        .in_channels = in_channels,
        .out_channels = settings.out_channels,
        .kernel = 1,
        .activation = settings.multi_scale ? Activation::kTanh : Activation::kRelu});
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

std::vector<at::Tensor> UNetImpl::forward(const at::Tensor& input) {
  at::Tensor x = head_.forward(input);
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
