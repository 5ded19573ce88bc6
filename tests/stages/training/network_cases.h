#pragma once

#include <ATen/core/Tensor.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "manifests/values/weights.h"

namespace eventgan::testing {

/// A dataset of the golden numbers as a float32 tensor, with a batch side of 1 in front if `batch`.
at::Tensor golden_tensor(const std::filesystem::path& file, const std::string& dataset,
                         bool batch = false);

/// GROUP/state as a state dict.
StateDict golden_state(const std::filesystem::path& file, const std::string& group);

/// max|a - b| / max|b|.
double relative_difference(const at::Tensor& a, const at::Tensor& b);

/// How far LibTorch's gradient of a scalar function is from central differences, along one random
/// direction through all inputs at once, relative to the latter. `inputs`: float64 leaves that
/// require gradients; they are left as they were.
double gradient_error(const std::function<at::Tensor()>& function, std::vector<at::Tensor> inputs);

}  // namespace eventgan::testing
