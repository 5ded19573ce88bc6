#include "tests/stages/generator/plain_int8_network.h"

#include <algorithm>
#include <cmath>

#include "stages/generator/calibration/quantized_kernel.h"
#include "stages/generator/calibration/quantized_network.h"
#include "stages/generator/calibration/quantized_tensors.h"
#include "tests/stages/generator/plain_network.h"

namespace eventgan::testing {
namespace {

/// Replaces the input channels of one tensor by what their 8-bit weights stand for.
void round_weights(Convolution& layer, const TensorUse& use, const TensorQuantization& input,
                   int largest_weight) {
  const std::size_t taps = std::size_t(layer.kernel) * layer.kernel;
  const std::size_t row = input.mean.size() * taps;
  const auto begin = [&](int out) {
    return layer.weight.begin() + (std::size_t(out) * layer.in_channels + use.first_channel) * taps;
  };
  std::vector<float> kernel;
  for (int out = 0; out < layer.out_channels; ++out) {
    kernel.insert(kernel.end(), begin(out), begin(out) + row);
  }
  const QuantizedKernel rounded =
      quantize_kernel(kernel, layer.out_channels, input.scale, input.mean, largest_weight);
  for (int out = 0; out < layer.out_channels; ++out) {
    for (std::size_t i = 0; i < row; ++i) {
      begin(out)[i] = rounded.values[out * row + i] * rounded.scales[out] / input.scale;
    }
    layer.bias[out] += rounded.bias_correction[out];
  }
}

}  // namespace

std::vector<float> plain_int8_network(const Weights& weights, const std::vector<float>& frames,
                                      ImageSize size, int largest_weight) {
  const QuantizableNetwork network = quantize_network(weights, *weights.calibration);
  Weights rounded{weights.base_channels, weights.bins, network.convolutions, {}, {}};
  for (const QuantizedTensor& tensor : quantized_tensors(weights.base_channels)) {
    for (const TensorUse& use : tensor.uses) {
      const auto layer =
          std::ranges::find(rounded.convolutions, use.convolution, &Convolution::name);
      round_weights(*layer, use, network.tensors.at(tensor.name), largest_weight);
    }
  }
  const auto store = [&](const std::string& name, std::vector<double>& values) {
    const auto tensor = network.tensors.find(name);
    if (tensor == network.tensors.end()) return;
    const double scale = tensor->second.scale;
    for (double& value : values) {
      value = scale * std::clamp(std::nearbyint(value / scale), 0.0, 255.0);
    }
  };
  return plain_network(rounded, frames, size, store);
}

}  // namespace eventgan::testing
