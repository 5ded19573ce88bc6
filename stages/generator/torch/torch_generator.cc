#include "stages/generator/torch/torch_generator.h"

#include <ATen/Functions.h>
#include <ATen/Parallel.h>
#include <ATen/Version.h>
#include <c10/core/InferenceMode.h>
#include <omp.h>
#include <torch/version.h>

#include <map>
#include <stdexcept>

namespace eventgan {
namespace {

constexpr double kLeakySlope = 0.01;
constexpr int kLevels = 4;

struct Layer {
  at::Tensor weight;
  at::Tensor bias;
  int stride = 1;
  int padding = 0;
};

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

class TorchGenerator final : public Generator {
 public:
  explicit TorchGenerator(const Weights& weights) : bins_(weights.bins) {
    check_weights(weights, "the weights");
    for (const Convolution& convolution : weights.convolutions) {
      const at::Tensor weight = at::from_blob(const_cast<float*>(convolution.weight.data()),
                                              {convolution.out_channels, convolution.in_channels,
                                               convolution.kernel, convolution.kernel});
      const at::Tensor bias =
          at::from_blob(const_cast<float*>(convolution.bias.data()), {convolution.out_channels});
      layers_[convolution.name] = {weight.clone(at::MemoryFormat::ChannelsLast), bias.clone(),
                                   convolution.stride, (convolution.kernel - 1) / 2};
    }
  }

  int bins() const override { return bins_; }

  std::string description() const override {
    return std::string("torch float32, 1 thread, LibTorch ") + TORCH_VERSION + ", " +
           at::get_mkldnn_version();
  }

  void generate(std::span<const float> frames, ImageSize size,
                std::span<float> volume) const override {
    const std::size_t plane = size.pixel_count();
    if (size.height < 1 || size.width < 1 || frames.size() != 2 * plane ||
        volume.size() != 2 * bins_ * plane) {
      throw std::invalid_argument(
          "expected frames [2, H, W] and a volume [" + std::to_string(2 * bins_) + ", H, W] of " +
          std::to_string(size.width) + "x" + std::to_string(size.height) + ", got " +
          std::to_string(frames.size()) + " and " + std::to_string(volume.size()) + " values");
    }
    use_one_thread();
    const c10::InferenceMode inference;
    try {
      const at::Tensor input =
          at::from_blob(const_cast<float*>(frames.data()), {1, 2, size.height, size.width});
      at::Tensor output = at::from_blob(volume.data(), {1, 2 * bins_, size.height, size.width});
      output.copy_(forward(input.contiguous(at::MemoryFormat::ChannelsLast)));
    } catch (const c10::Error&) {
      std::throw_with_nested(std::runtime_error("the generator failed in LibTorch"));
    }
  }

 private:
  at::Tensor convolve(const std::string& name, const at::Tensor& x) const {
    const Layer& layer = layers_.at(name);
    return at::conv2d(x, layer.weight, layer.bias, layer.stride, layer.padding);
  }

  at::Tensor residual(const std::string& block, const at::Tensor& x) const {
    at::Tensor y = convolve(block + ".conv1", x);
    at::relu_(y);
    y = convolve(block + ".conv2", y);
    return at::relu_(y.add_(x));
  }

  at::Tensor forward(at::Tensor x) const {
    x = convolve("head", x);
    at::leaky_relu_(x, kLeakySlope);
    std::vector<at::Tensor> skips;
    for (int level = 0; level < kLevels; ++level) {
      skips.push_back(x);
      x = convolve("encoders." + std::to_string(level), x);
      at::leaky_relu_(x, kLeakySlope);
    }
    x = residual("resblocks.0", x);
    x = residual("resblocks.1", x);
    for (int level = 0; level < kLevels; ++level) {
      const at::Tensor skip = std::move(skips.back());
      skips.pop_back();
      x = at::upsample_nearest2d(x, {skip.size(2), skip.size(3)});
      x = convolve("decoders." + std::to_string(level), at::cat({x, skip}, 1));
      at::leaky_relu_(x, kLeakySlope);
    }
    x = convolve("pred", x);
    return at::relu_(x);
  }

  int bins_;
  std::map<std::string, Layer> layers_;
};

}  // namespace

std::unique_ptr<Generator> make_torch_generator(const Weights& weights) {
  return std::make_unique<TorchGenerator>(weights);
}

}  // namespace eventgan
