#pragma once

#include <ATen/core/Tensor.h>

#include <string>
#include <vector>

namespace eventgan {

/// Throws std::invalid_argument if `tensor` does not have these sides, -1 standing for any that is
/// not 0: else LibTorch would broadcast silently, and a loss compare the wrong samples.
void require_sides(const at::Tensor& tensor, const std::vector<std::int64_t>& sides,
                   const std::string& what);

}  // namespace eventgan
