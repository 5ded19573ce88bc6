#include "stages/generator/torch/detail/network_forward.h"

#include <ATen/Context.h>
#include <ATen/Functions.h>
#include <ATen/Parallel.h>
#include <ATen/core/Tensor.h>
#include <omp.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/generator/decoder_kernels.h"
#include "stages/generator/weights.h"

namespace eventgan {
namespace {

/// at::conv2d for one group, on the CPU by oneDNN wherever LibTorch has it: left to itself LibTorch
/// takes small tensors to a matrix product of its own, which with a plain BLAS is several times
/// slower. bias: [out], or none. Thread safe. Throws c10::Error.
at::Tensor convolution(const at::Tensor& x, const at::Tensor& weight, const at::Tensor& bias,
                       int stride, int padding) {
  if (!x.is_cpu() || !at::hasMKLDNN()) return at::conv2d(x, weight, bias, stride, padding);
  const std::int64_t paddings[] = {padding, padding};
  const std::int64_t strides[] = {stride, stride};
  const std::int64_t dilations[] = {1, 1};
  return at::mkldnn_convolution(x, weight, bias, paddings, strides, dilations, /*groups=*/1);
}

constexpr int kRows = 2;  // dimension of a tensor [B, C, H, W]
constexpr int kColumns = 3;

/// Every second position from `first` on, `count` of them.
at::Tensor every_second(const at::Tensor& x, int dimension, std::int64_t first,
                        std::int64_t count) {
  return x.slice(dimension, first, first + 2 * count, 2);
}

/// The last two positions of the doubled image, or the only one.
at::Tensor doubled_end(const at::Tensor& x, int dimension, std::int64_t doubled_size) {
  const std::int64_t count = std::min<std::int64_t>(doubled_size, 2);
  return x.slice(dimension, x.size(dimension) - count);
}

/// Nearest doubling along one dimension.
at::Tensor doubled_along(const at::Tensor& x, int dimension, std::int64_t doubled_size) {
  const at::Tensor positions =
      at::arange(doubled_size, x.options().dtype(at::kLong)).floor_divide(2);
  return x.index_select(dimension, positions).contiguous(at::MemoryFormat::ChannelsLast);
}

}  // namespace

at::Tensor kernel_tensor(const std::vector<float>& kernel, int out_channels, int in_channels,
                         int side, const at::TensorOptions& kind) {
  const at::Tensor values =
      at::from_blob(const_cast<float*>(kernel.data()), {out_channels, in_channels, side, side});
  return values.to(kind, /*non_blocking=*/false, /*copy=*/true, at::MemoryFormat::ChannelsLast);
}

at::Tensor bias_tensor(const std::vector<float>& bias, const at::TensorOptions& kind) {
  const auto count = static_cast<std::int64_t>(bias.size());
  return at::from_blob(const_cast<float*>(bias.data()), {count}).to(kind, false, /*copy=*/true);
}

DecoderForward::DecoderForward(const Convolution& decoder, const at::TensorOptions& kind) {
  const DecoderKernels kernels = decoder_kernels(decoder);
  const int out = decoder.out_channels;
  const int in = kernels.doubled_channels;
  skip_ = kernel_tensor(kernels.skip, out, out, 3, kind);
  bias_ = bias_tensor(decoder.bias, kind);
  phases_ = kernel_tensor(kernels.phases, 4 * out, in, 2, kind);
  doubled_ = kernel_tensor(kernels.doubled, out, in, 3, kind);
}

at::Tensor DecoderForward::operator()(const at::Tensor& x, const at::Tensor& skip) const {
  at::Tensor sum = convolution(skip, skip_, bias_, 1, 1);
  add_phases(x, sum);
  if (sum.size(kRows) % 2 == 1) add_last_row(x, sum);
  if (sum.size(kColumns) % 2 == 1) add_last_column(x, sum);
  return sum;
}

void DecoderForward::add_phases(const at::Tensor& x, at::Tensor& sum) const {
  const std::int64_t out = sum.size(1);
  // Of both phases alike: the last row and column of an odd size see the padding, and come apart.
  const std::int64_t rows = sum.size(kRows) / 2;
  const std::int64_t columns = sum.size(kColumns) / 2;
  if (rows == 0 || columns == 0) return;
  const at::Tensor phases = convolution(x, phases_, {}, 1, 1);
  for (int phase = 0; phase < 4; ++phase) {
    const int row = phase / 2, column = phase % 2;
    every_second(every_second(sum, kRows, row, rows), kColumns, column, columns)
        .add_(phases.narrow(1, phase * out, out)
                  .narrow(kRows, row, rows)
                  .narrow(kColumns, column, columns));
  }
}

void DecoderForward::add_last_row(const at::Tensor& x, at::Tensor& sum) const {
  const std::int64_t height = sum.size(kRows);
  const at::Tensor end = doubled_along(doubled_end(x, kRows, height), kColumns, sum.size(kColumns));
  sum.slice(kRows, height - 1).add_(convolution(end, doubled_, {}, 1, 1).slice(kRows, -1));
}

void DecoderForward::add_last_column(const at::Tensor& x, at::Tensor& sum) const {
  const std::int64_t height = sum.size(kRows), width = sum.size(kColumns);
  const std::int64_t rows =
      height - height % 2;  // the last row of an odd height has all of its own
  if (rows == 0) return;
  const at::Tensor end = doubled_along(doubled_end(x, kColumns, width), kRows, height);
  sum.narrow(kRows, 0, rows)
      .slice(kColumns, width - 1)
      .add_(convolution(end, doubled_, {}, 1, 1).narrow(kRows, 0, rows).slice(kColumns, -1));
}

void use_one_thread() {
  thread_local const bool done = [] {
    at::set_num_threads(1);
    omp_set_num_threads(1);
    return true;
  }();
  static_cast<void>(done);
}

NetworkForward::NetworkForward(const Weights& weights, const at::TensorOptions& kind) try
    : kind_(kind) {
  check_weights(weights, "the weights");
  for (const Convolution& convolution : weights.convolutions) {
    if (convolution.name.starts_with("decoders.")) {
      decoders_.emplace_back(convolution, kind);
      continue;
    }
    layers_[convolution.name] = {kernel_tensor(convolution.weight, convolution.out_channels,
                                               convolution.in_channels, convolution.kernel, kind),
                                 bias_tensor(convolution.bias, kind), convolution.stride,
                                 (convolution.kernel - 1) / 2};
  }
} catch (const c10::Error&) {
  std::throw_with_nested(std::runtime_error("the generator could not be set up in LibTorch"));
}

at::Tensor NetworkForward::convolve(const std::string& name, const at::Tensor& x) const {
  const Layer& layer = layers_.at(name);
  return convolution(x, layer.weight, layer.bias, layer.stride, layer.padding);
}

at::Tensor NetworkForward::leaky(const std::string& name, const at::Tensor& x) const {
  at::Tensor y = convolve(name, x);
  return at::leaky_relu_(y, kLeakySlope);
}

at::Tensor NetworkForward::residual(const std::string& block, const at::Tensor& x) const {
  at::Tensor y = convolve(block + ".conv1", x);
  y = convolve(block + ".conv2", at::relu_(y));
  return at::relu_(y.add_(x));
}

at::Tensor NetworkForward::operator()(std::span<const float> planes, ImageSize size) const {
  return (*this)(at::from_blob(
      const_cast<float*>(planes.data()),
      {1, static_cast<std::int64_t>(planes.size() / size.pixel_count()), size.height, size.width}));
}

at::Tensor NetworkForward::operator()(const at::Tensor& frames) const {
  use_one_thread();
  // First to the device, there into its type: the other way round the CPU would convert.
  at::Tensor x = frames.to(kind_.device(), frames.scalar_type(), /*non_blocking=*/true)
                     .to(kind_)
                     .contiguous(at::MemoryFormat::ChannelsLast);
  x = leaky("head", x);
  std::vector<at::Tensor> skips;
  for (int level = 0; level < kNetworkLevels; ++level) {
    skips.push_back(x);
    x = leaky("encoders." + std::to_string(level), x);
  }
  x = residual("resblocks.0", x);
  x = residual("resblocks.1", x);
  for (int level = 0; level < kNetworkLevels; ++level) {
    const at::Tensor skip = std::move(skips.back());
    skips.pop_back();
    x = decoders_[level](x, skip);
    at::leaky_relu_(x, kLeakySlope);
  }
  x = convolve("pred", x);
  return at::relu_(x);
}

}  // namespace eventgan
