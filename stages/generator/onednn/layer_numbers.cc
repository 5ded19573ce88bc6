#include "stages/generator/onednn/layer_numbers.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stages/generator/calibration.h"
#include "stages/generator/decoder_kernels.h"
#include "stages/generator/quantized_network.h"

namespace eventgan {

std::vector<float> bias_behind_scales(const LayerNumbers& layer) {
  std::vector<float> bias = layer.bias;
  if (layer.output_scales.empty()) return bias;
  std::ranges::transform(bias, layer.output_scales, bias.begin(), std::multiplies());
  return bias;
}

bool is_float32_layer(const std::string& name) { return name == "head" || name == "pred"; }

NetworkNumbers float_numbers(const Weights& weights) {
  NetworkNumbers numbers;
  for (const Convolution& convolution : weights.convolutions) {
    const std::string& name = convolution.name;
    const int out = convolution.out_channels;
    if (!name.starts_with("decoders.")) {
      numbers.layers.push_back({name,
                                out,
                                convolution.in_channels,
                                convolution.kernel,
                                convolution.weight,
                                convolution.bias,
                                {}});
      continue;
    }
    const DecoderKernels kernels = decoder_kernels(convolution);
    const int in = kernels.doubled_channels;
    numbers.layers.push_back({name + ".skip", out, out, 3, kernels.skip, convolution.bias, {}});
    numbers.layers.push_back({name + ".phases", 4 * out, in, 2, kernels.phases, {}, {}});
    numbers.layers.push_back({name + ".last_row", out, in, 3, kernels.doubled, {}, {}});
    numbers.layers.push_back({name + ".last_column", out, in, 3, kernels.transposed, {}, {}});
  }
  return numbers;
}

namespace {

/// Which stored tensors each convolution reads, in the order of its channels, and makes.
struct TensorNames {
  std::map<std::string, std::vector<std::string>> inputs;
  std::map<std::string, std::string> output;
  std::map<std::string, std::string> addend;  ///< of a residual block's second convolution
};

TensorNames tensor_names(int base_channels) {
  TensorNames names;
  for (const QuantizedTensor& tensor : quantized_tensors(base_channels)) {
    names.output[tensor.producer] = tensor.name;
    if (!tensor.addend.empty()) names.addend[tensor.producer] = tensor.addend;
    for (const TensorUse& use : tensor.uses) {
      auto& inputs = names.inputs[use.convolution];
      inputs.insert(use.first_channel == 0 ? inputs.begin() : inputs.end(), tensor.name);
    }
  }
  return names;
}

/// No sum of inputs of at most `largest_input` may be infinite either: of two infinities of other
/// signs comes NaN, which 8 bits hold as 0.
void check_finite(const LayerNumbers& layer, double largest_input) {
  bool finite = all_finite(layer.weight) && all_finite(layer.output_scales);
  const std::size_t row_size = layer.weight.size() / layer.out_channels;
  for (int o = 0; finite && o < layer.out_channels; ++o) {
    double largest = layer.bias.empty() ? 0 : std::abs(layer.bias[o]);
    for (std::size_t i = 0; i < row_size; ++i) {
      largest += largest_input * std::abs(layer.weight[o * row_size + i]);
    }
    if (!layer.output_scales.empty()) largest *= std::max(layer.output_scales[o], 1.0f);
    finite = largest <= std::numeric_limits<float>::max();
  }
  if (finite) return;
  throw std::invalid_argument("expected finite numbers in steps of the tensors, got others for " +
                              layer.name);
}

/// Turns float kernels into whole ones with scales that lead to the output tensor's step.
class LayerQuantizer {
 public:
  LayerQuantizer(const QuantizableNetwork& network, int largest_weight)
      : network_(network), largest_weight_(largest_weight) {}

  float step(const std::string& tensor) const { return network_.tensors.at(tensor).scale; }

  /// bias: [out] real, or empty for zeros. out_step: of the tensor the result is stored as.
  LayerNumbers layer(const std::string& name, int side, const std::vector<float>& kernel, int out,
                     const std::vector<float>& bias, const std::string& input,
                     float out_step) const {
    const TensorQuantization& tensor = network_.tensors.at(input);
    const QuantizedKernel quantized = quantized_kernel(name, kernel, out, tensor);
    LayerNumbers numbers{name, out, static_cast<int>(tensor.mean.size()), side, {}, {}, {}};
    numbers.weight.assign(quantized.values.begin(), quantized.values.end());
    for (int o = 0; o < out; ++o) {
      const float real_bias = (bias.empty() ? 0.0f : bias[o]) + quantized.bias_correction[o];
      numbers.bias.push_back(real_bias / quantized.scales[o]);
      numbers.output_scales.push_back(quantized.scales[o] / out_step);
    }
    check_finite(numbers, kLargestStored);
    return numbers;
  }

 private:
  QuantizedKernel quantized_kernel(const std::string& name, const std::vector<float>& kernel,
                                   int out, const TensorQuantization& input) const try {
    return quantize_kernel(kernel, out, input.scale, input.mean, largest_weight_);
  } catch (const std::invalid_argument&) {
    std::throw_with_nested(std::invalid_argument("cannot compute " + name + " in int8"));
  }

  const QuantizableNetwork& network_;
  int largest_weight_;
};

}  // namespace

NetworkNumbers int8_numbers(const Weights& weights, int largest_weight) {
  if (!weights.calibration) {
    throw std::invalid_argument("expected weights with a calibration for int8, got none");
  }
  const QuantizableNetwork network = quantize_network(weights, *weights.calibration);
  const TensorNames names = tensor_names(weights.base_channels);
  const LayerQuantizer quantizer(network, largest_weight);
  NetworkNumbers numbers;
  for (const Convolution& convolution : network.convolutions) {
    const std::string& name = convolution.name;
    const int out = convolution.out_channels;
    const int side = convolution.kernel;
    // What nothing stores is in real units: the last decoder's output.
    const auto output = names.output.find(name);
    const float out_step = output == names.output.end() ? 1 : quantizer.step(output->second);
    if (is_float32_layer(name)) {
      LayerNumbers layer{
          name, out, convolution.in_channels, side, convolution.weight, convolution.bias, {}};
      for (float& value : layer.weight) value /= out_step;
      for (float& value : layer.bias) value /= out_step;
      // Frames are in [-1, 1]; what `pred` makes is a volume, in which nothing gets lost.
      check_finite(layer, name == "head" ? 1 : 0);
      numbers.layers.push_back(std::move(layer));
      continue;
    }
    const std::vector<std::string>& inputs = names.inputs.at(name);
    if (!name.starts_with("decoders.")) {
      numbers.layers.push_back(quantizer.layer(name, side, convolution.weight, out,
                                               convolution.bias, inputs[0], out_step));
      if (const auto addend = names.addend.find(name); addend != names.addend.end()) {
        const int block = name.starts_with("resblocks.0") ? 0 : 1;
        const float factor = quantizer.step(addend->second) / out_step;
        check_finite({name, 1, 1, 1, {factor}, {}, {}}, kLargestStored);
        numbers.residual_factors[block] = factor;
      }
      continue;
    }
    const DecoderKernels kernels = decoder_kernels(convolution);
    numbers.layers.push_back(quantizer.layer(name + ".skip", 3, kernels.skip, out, convolution.bias,
                                             inputs[1], out_step));
    numbers.layers.push_back(
        quantizer.layer(name + ".phases", 2, kernels.phases, 4 * out, {}, inputs[0], out_step));
    numbers.layers.push_back(
        quantizer.layer(name + ".last_row", 3, kernels.doubled, out, {}, inputs[0], out_step));
    numbers.layers.push_back(quantizer.layer(name + ".last_column", 3, kernels.transposed, out, {},
                                             inputs[0], out_step));
  }
  return numbers;
}

}  // namespace eventgan
