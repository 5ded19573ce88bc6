#include "tests/stages/training/network_cases.h"

#include <ATen/Functions.h>
#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>

#include <cmath>

#include "manifests/values/counter_random.h"
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

namespace {

std::vector<at::Tensor> random_direction(const std::vector<at::Tensor>& inputs) {
  std::vector<at::Tensor> direction;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const CounterRandom random = CounterRandom(17).keyed(std::to_string(i));
    at::Tensor part = at::empty(inputs[i].sizes(), at::kDouble);
    double* values = part.data_ptr<double>();
    for (std::int64_t k = 0; k < part.numel(); ++k) values[k] = 2 * random.uniform(k) - 1;
    direction.push_back(part);
  }
  return direction;
}

}  // namespace

double gradient_error(const std::function<at::Tensor()>& function, std::vector<at::Tensor> inputs) {
  const auto direction = random_direction(inputs);
  function().backward();
  double analytic = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    analytic += (inputs[i].grad() * direction[i]).sum().item<double>();
  }
  const at::NoGradGuard numbers_only;
  const auto value_at = [&](double distance) {
    for (std::size_t i = 0; i < inputs.size(); ++i) inputs[i].add_(direction[i], distance);
    const double value = function().item<double>();
    for (std::size_t i = 0; i < inputs.size(); ++i) inputs[i].sub_(direction[i], distance);
    return value;
  };
  // Small enough that next to no ReLU changes sides, large enough for float64.
  constexpr double kStep = 1e-7;
  const double numeric = (value_at(kStep) - value_at(-kStep)) / (2 * kStep);
  return std::abs(analytic - numeric) / std::abs(numeric);
}

}  // namespace eventgan::testing
