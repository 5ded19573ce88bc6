#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/batchnorm.h>
#include <torch/nn/modules/container/any.h>
#include <torch/nn/options/conv.h>
#include <torch/nn/pimpl.h>

namespace eventgan {

enum class Activation { kLeakyRelu, kRelu, kTanh };  ///< leaky: slope 0.01

/// A convolution, plain or spectral-normalised, to be registered under a name of its own: forward
/// takes and gives one tensor.
torch::nn::AnyModule make_convolution(const torch::nn::Conv2dOptions& options, bool spectral_norm);

struct ConvLayerSettings {
  int in_channels = 0;
  int out_channels = 0;
  int kernel = 3;  ///< side in pixels; padding keeps the size at stride 1
  int stride = 1;
  bool batch_norm = false;  ///< then the convolution has no bias
  bool spectral_norm = false;
  Activation activation = Activation::kLeakyRelu;
};

/// `conv2d`, `norm_layer` (momentum 0.01), activation.
class ConvLayerImpl : public torch::nn::Module {
 public:
  explicit ConvLayerImpl(const ConvLayerSettings& settings);
  at::Tensor forward(const at::Tensor& input);

 private:
  torch::nn::AnyModule convolution_;
  torch::nn::BatchNorm2d norm_{nullptr};
  Activation activation_;
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

}  // namespace eventgan
