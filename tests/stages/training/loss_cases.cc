#include "tests/stages/training/loss_cases.h"

#include <ATen/ops/from_blob.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "manifests/values/counter_random.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"

namespace eventgan::testing {

at::Tensor tensor_of(const std::vector<std::int64_t>& shape, const std::vector<float>& values) {
  std::vector<float> copy(values);  // from_blob takes no const pointer.
  return at::from_blob(copy.data(), shape, at::kFloat).clone();
}

at::Tensor golden_tensor(const std::string& dataset) {
  const GoldenArray array = read_array(shared_data() / "golden" / "golden.h5", dataset);
  return tensor_of({array.shape.begin(), array.shape.end()}, array.values);
}

at::Tensor random_tensor(const std::vector<std::int64_t>& shape, std::uint64_t seed) {
  const CounterRandom random(seed);
  std::int64_t count = 1;
  for (const std::int64_t side : shape) count *= side;
  std::vector<double> values(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 2 * random.uniform(i) - 1;
  return at::from_blob(values.data(), shape, at::kDouble).clone();
}

void expect_gradient_of_differences(const std::function<at::Tensor(const at::Tensor&)>& function,
                                    const at::Tensor& at) {
  const at::Tensor leaf = at.clone().requires_grad_(true);
  function(leaf).backward();
  ASSERT_TRUE(leaf.grad().defined());
  const at::Tensor gradient = leaf.grad().contiguous();

  constexpr double kStep = 1e-6;
  const double largest = gradient.abs().max().item<double>();
  EXPECT_GT(largest, 0) << "a gradient of zero checks nothing";
  for (std::int64_t i = 0; i < at.numel(); ++i) {
    const auto value_at = [&](double offset) {
      at::Tensor moved = at.clone();
      moved.data_ptr<double>()[i] += offset;
      return function(moved).item<double>();
    };
    const double difference = (value_at(kStep) - value_at(-kStep)) / (2 * kStep);
    EXPECT_NEAR(gradient.data_ptr<double>()[i], difference, 1e-6 * std::max(1.0, largest))
        << "element " << i;
  }
}

}  // namespace eventgan::testing
