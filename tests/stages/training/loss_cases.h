#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace eventgan::testing {

/// Float32 tensor with these values in C order.
at::Tensor tensor_of(const std::vector<std::int64_t>& shape, const std::vector<float>& values);

/// A dataset of the golden numbers.
at::Tensor golden_tensor(const std::string& dataset);

/// Float64, uniform in [-1, 1); the same for the same seed on every machine.
at::Tensor random_tensor(const std::vector<std::int64_t>& shape, std::uint64_t seed);

/// Expects the gradient of a scalar function of a float64 tensor to be what central differences
/// say.
void expect_gradient_of_differences(const std::function<at::Tensor(const at::Tensor&)>& function,
                                    const at::Tensor& at);

}  // namespace eventgan::testing
