#include "tests/stages/training/networks/golden_network.h"

#include <ATen/Functions.h>
#include <ATen/TensorOperators.h>

#include "tests/testing/golden_numbers.h"

namespace eventgan::testing {

at::Tensor golden_tensor(const std::filesystem::path& file, const std::string& dataset,
                         bool batch) {
  GoldenArray array = read_array(file, dataset);
  const std::vector<std::int64_t> shape(array.shape.begin(), array.shape.end());
  const at::Tensor tensor = at::from_blob(array.values.data(), shape).clone();
  return batch ? tensor.unsqueeze(0) : tensor;
}

StateDict golden_state(const std::filesystem::path& file, const std::string& group) {
  StateDict state;
  for (const std::string& name : member_names(file, group + "/state")) {
    GoldenArray array = read_array(file, group + "/state/" + name);
    state[name] = {{array.shape.begin(), array.shape.end()}, std::move(array.values)};
  }
  return state;
}

double relative_difference(const at::Tensor& a, const at::Tensor& b) {
  return (a - b).abs().max().item<double>() / b.abs().max().item<double>();
}

}  // namespace eventgan::testing
