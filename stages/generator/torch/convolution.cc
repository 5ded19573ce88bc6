#include <ATen/Context.h>
#include <ATen/Functions.h>

#include "stages/generator/torch/convolution_internal.h"

namespace eventgan {

at::Tensor convolution(const at::Tensor& x, const at::Tensor& weight, const at::Tensor& bias,
                       int stride, int padding) {
  if (!at::hasMKLDNN()) return at::conv2d(x, weight, bias, stride, padding);
  const std::int64_t paddings[] = {padding, padding};
  const std::int64_t strides[] = {stride, stride};
  const std::int64_t dilations[] = {1, 1};
  return at::mkldnn_convolution(x, weight, bias, paddings, strides, dilations, /*groups=*/1);
}

}  // namespace eventgan
