#include "stages/generator/untrained.h"

#include <cmath>
#include <numbers>

#include "manifests/counter_random.h"

namespace eventgan {

Weights untrained_weights(int base_channels, int bins, std::uint64_t seed) {
  Weights weights{base_channels, bins, network_layout(base_channels, bins), {}, nullptr};
  weights.metadata["origin"] = "untrained, seed " + std::to_string(seed);
  for (Convolution& layer : weights.convolutions) {
    const CounterRandom random = CounterRandom(seed).keyed(layer.name);
    const int fan_in = layer.in_channels * layer.kernel * layer.kernel;
    const double deviation = std::sqrt(2.0 / fan_in);
    layer.weight.resize(std::size_t(layer.out_channels) * fan_in);
    for (std::size_t i = 0; i < layer.weight.size(); ++i) {
      // Box-Muller; 1 - u keeps the logarithm's argument above 0.
      const double radius = std::sqrt(-2.0 * std::log(1.0 - random.uniform(2 * i)));
      const double angle = 2.0 * std::numbers::pi * random.uniform(2 * i + 1);
      layer.weight[i] = static_cast<float>(deviation * radius * std::cos(angle));
    }
    layer.bias.assign(layer.out_channels, 0.0f);
  }
  return weights;
}

}  // namespace eventgan
