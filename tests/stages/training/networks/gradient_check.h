#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <vector>

namespace eventgan::testing {

/// How far LibTorch's gradient of a scalar function is from central differences, along one random
/// direction through all inputs at once, relative to the latter. `inputs`: float64 leaves that
/// require gradients; they are left as they were.
double gradient_error(const std::function<at::Tensor()>& function, std::vector<at::Tensor> inputs);

}  // namespace eventgan::testing
