#pragma once

#include <ATen/core/Tensor.h>

namespace eventgan {

/// at::conv2d for one group, by oneDNN wherever LibTorch has it: left to itself LibTorch takes
/// small tensors to a matrix product of its own, which with a plain BLAS is several times slower.
/// bias: [out], or none. Thread safe. Throws c10::Error.
at::Tensor convolution(const at::Tensor& x, const at::Tensor& weight, const at::Tensor& bias,
                       int stride, int padding);

}  // namespace eventgan
