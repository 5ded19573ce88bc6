#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace eventgan {

/// A tensor as a checkpoint or weights file holds it, converted to float32.
struct NamedTensor {
  std::vector<std::int64_t> shape;
  std::vector<float> values;  ///< C order, as many as the shape says
};

/// Tensors by name, as PyTorch's state_dict().
using StateDict = std::map<std::string, NamedTensor>;

}  // namespace eventgan
