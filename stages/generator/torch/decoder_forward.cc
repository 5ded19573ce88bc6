#include <ATen/Functions.h>

#include <algorithm>

#include "stages/generator/decoder_kernels.h"
#include "stages/generator/torch/convolution_internal.h"
#include "stages/generator/torch/decoder_forward_internal.h"

namespace eventgan {
namespace {

constexpr int kRows = 2;  // dimension of a tensor [1, C, H, W]
constexpr int kColumns = 3;

/// Every second position from `first` on, `count` of them.
at::Tensor every_second(const at::Tensor& x, int dimension, std::int64_t first,
                        std::int64_t count) {
  return x.slice(dimension, first, first + 2 * count, 2);
}

/// The last two positions of the doubled picture, or the only one.
at::Tensor doubled_end(const at::Tensor& x, int dimension, std::int64_t doubled_size) {
  const std::int64_t count = std::min<std::int64_t>(doubled_size, 2);
  return x.slice(dimension, x.size(dimension) - count);
}

/// Nearest doubling along one dimension.
at::Tensor doubled_along(const at::Tensor& x, int dimension, std::int64_t doubled_size) {
  const at::Tensor positions = at::arange(doubled_size, at::kLong).floor_divide(2);
  return x.index_select(dimension, positions).contiguous(at::MemoryFormat::ChannelsLast);
}

}  // namespace

at::Tensor kernel_tensor(const std::vector<float>& kernel, int out_channels, int in_channels,
                         int side, at::ScalarType type) {
  const at::Tensor values =
      at::from_blob(const_cast<float*>(kernel.data()), {out_channels, in_channels, side, side});
  return values.to(type, /*non_blocking=*/false, /*copy=*/true, at::MemoryFormat::ChannelsLast);
}

at::Tensor bias_tensor(const std::vector<float>& bias, at::ScalarType type) {
  const auto count = static_cast<std::int64_t>(bias.size());
  return at::from_blob(const_cast<float*>(bias.data()), {count}).to(type, false, /*copy=*/true);
}

DecoderForward::DecoderForward(const Convolution& decoder, at::ScalarType type) {
  const DecoderKernels kernels = decoder_kernels(decoder);
  const int out = decoder.out_channels;
  const int in = kernels.doubled_channels;
  skip_ = kernel_tensor(kernels.skip, out, out, 3, type);
  bias_ = bias_tensor(decoder.bias, type);
  phases_ = kernel_tensor(kernels.phases, 4 * out, in, 2, type);
  doubled_ = kernel_tensor(kernels.doubled, out, in, 3, type);
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

}  // namespace eventgan
