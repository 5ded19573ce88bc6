#include <ATen/Functions.h>
#include <ATen/Parallel.h>
#include <omp.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/generator/network_shape.h"
#include "stages/generator/torch/convolution_internal.h"
#include "stages/generator/torch/network_forward_internal.h"

namespace eventgan {
namespace {

/// LibTorch keeps its thread count per calling thread, and oneDNN reads OpenMP's; without both, a
/// worker silently takes every core. The last bits of a convolution depend on the count, so it is
/// one, always.
void use_one_thread() {
  thread_local const bool done = [] {
    at::set_num_threads(1);
    omp_set_num_threads(1);
    return true;
  }();
  static_cast<void>(done);
}

at::Tensor observed(const std::string& name, at::Tensor x, const TensorObserver& observe) {
  if (observe) observe(name, x);
  return x;
}

}  // namespace

NetworkForward::NetworkForward(const Weights& weights, at::ScalarType type) try : type_(type) {
  check_weights(weights, "the weights");
  for (const Convolution& convolution : weights.convolutions) {
    if (convolution.name.starts_with("decoders.")) {
      decoders_.emplace_back(convolution, type);
      continue;
    }
    layers_[convolution.name] = {kernel_tensor(convolution.weight, convolution.out_channels,
                                               convolution.in_channels, convolution.kernel, type),
                                 bias_tensor(convolution.bias, type), convolution.stride,
                                 (convolution.kernel - 1) / 2};
  }
} catch (const c10::Error&) {
  std::throw_with_nested(std::runtime_error("the generator could not be set up in LibTorch"));
}

at::Tensor NetworkForward::convolve(const std::string& name, const at::Tensor& x) const {
  const Layer& layer = layers_.at(name);
  return convolution(x, layer.weight, layer.bias, layer.stride, layer.padding);
}

at::Tensor NetworkForward::leaky(const std::string& name, const at::Tensor& x,
                                 const TensorObserver& observe) const {
  at::Tensor y = convolve(name, x);
  return observed(name, at::leaky_relu_(y, kLeakySlope), observe);
}

at::Tensor NetworkForward::residual(const std::string& block, const at::Tensor& x,
                                    const TensorObserver& observe) const {
  at::Tensor y = convolve(block + ".conv1", x);
  y = observed(block + ".conv1", at::relu_(y), observe);
  y = convolve(block + ".conv2", y);
  return observed(block, at::relu_(y.add_(x)), observe);
}

at::Tensor NetworkForward::operator()(std::span<const float> frames, ImageSize size,
                                      const TensorObserver& observe) const {
  use_one_thread();
  at::Tensor x = at::from_blob(const_cast<float*>(frames.data()), {1, 2, size.height, size.width})
                     .to(type_)
                     .contiguous(at::MemoryFormat::ChannelsLast);
  x = leaky("head", x, observe);
  std::vector<at::Tensor> skips;
  for (int level = 0; level < kNetworkLevels; ++level) {
    skips.push_back(x);
    x = leaky("encoders." + std::to_string(level), x, observe);
  }
  x = residual("resblocks.0", x, observe);
  x = residual("resblocks.1", x, observe);
  for (int level = 0; level < kNetworkLevels; ++level) {
    const at::Tensor skip = std::move(skips.back());
    skips.pop_back();
    x = decoders_[level](x, skip);
    x = observed("decoders." + std::to_string(level), at::leaky_relu_(x, kLeakySlope), observe);
  }
  x = convolve("pred", x);
  return observed("pred", at::relu_(x), observe);
}

}  // namespace eventgan
