#include <ATen/core/grad_mode.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "manifests/counter_random.h"
#include "stages/training/networks/initialization_internal.h"

namespace eventgan {
namespace {

/// A number of the wanted distribution for the value at an index.
using Draw = std::function<double(std::uint64_t)>;

void fill(at::Tensor& tensor, const Draw& draw) {
  std::vector<float> values(static_cast<std::size_t>(tensor.numel()));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(draw(i));
  const at::NoGradGuard not_a_step;
  tensor.copy_(at::from_blob(values.data(), tensor.sizes()));
}

Draw normal(CounterRandom random, double deviation) {
  return [=](std::uint64_t i) {
    // Box-Muller; 1 - u keeps the logarithm's argument above 0.
    const double radius = std::sqrt(-2 * std::log(1 - random.uniform(2 * i)));
    return deviation * radius * std::cos(2 * std::numbers::pi * random.uniform(2 * i + 1));
  };
}

Draw uniform(CounterRandom random, double limit) {
  return [=](std::uint64_t i) { return limit * (2 * random.uniform(i) - 1); };
}

double fan_in(const at::Tensor& weight) { return double(weight.numel()) / double(weight.size(0)); }

void fill_unit_vector(at::Tensor& tensor, CounterRandom random) {
  fill(tensor, normal(random, 1));
  tensor.div_(tensor.norm());
}

}  // namespace

void initialize(UNetImpl& network, std::uint64_t seed) {
  constexpr double kGainSquared = 2.0 / (1 + 10 * 10);
  for (auto& item : network.named_parameters()) {
    const CounterRandom random = CounterRandom(seed).keyed(item.key());
    at::Tensor& parameter = item.value();
    if (item.key().ends_with("weight_bar")) {
      fill(parameter, uniform(random, 1 / std::sqrt(fan_in(parameter))));
    } else if (parameter.dim() == 4) {
      fill(parameter, normal(random, std::sqrt(kGainSquared / fan_in(parameter))));
    } else {  // batch norm's scale, or a bias or shift
      const double value = item.key().ends_with(".weight") ? 1 : 0;
      fill(parameter, [=](std::uint64_t) { return value; });
    }
  }
  for (auto& item : network.named_buffers()) {
    at::Tensor& buffer = item.value();
    if (item.key().ends_with("weight_u") || item.key().ends_with("weight_v")) {
      fill_unit_vector(buffer, CounterRandom(seed).keyed(item.key()));
    } else {
      buffer.fill_(item.key().ends_with("running_var") ? 1 : 0);
    }
  }
}

void initialize(PatchDiscriminatorImpl& network, std::uint64_t seed) {
  double limit = 0;
  for (auto& item : network.named_parameters()) {
    at::Tensor& parameter = item.value();
    // A convolution's bias follows its weight and has the same limit.
    if (parameter.dim() == 4) limit = 1 / std::sqrt(fan_in(parameter));
    fill(parameter, uniform(CounterRandom(seed).keyed(item.key()), limit));
  }
}

}  // namespace eventgan
