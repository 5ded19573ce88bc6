#pragma once

#include <ATen/core/Tensor.h>

#include <filesystem>
#include <string>

#include "manifests/state_dict.h"

namespace eventgan::testing {

/// A dataset of the golden numbers as a float32 tensor, with a batch side of 1 in front if `batch`.
at::Tensor golden_tensor(const std::filesystem::path& file, const std::string& dataset,
                         bool batch = false);

/// GROUP/state as a state dict.
StateDict golden_state(const std::filesystem::path& file, const std::string& group);

/// max|a - b| / max|b|.
double relative_difference(const at::Tensor& a, const at::Tensor& b);

}  // namespace eventgan::testing
