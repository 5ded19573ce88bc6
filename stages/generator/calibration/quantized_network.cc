#include "stages/generator/calibration/quantized_network.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "stages/generator/calibration/quantized_kernel.h"
#include "stages/generator/calibration/quantized_tensors.h"

namespace eventgan {
namespace {

/// The exponent of the channels' factors: between leaving the ranges as they are, which spends the
/// tensor's steps on its widest channel, and making them equal, which spends the weights' steps.
constexpr double kEvenness = 0.5;

/// What is stored reaches this far beyond the highest value of the calibration's pairs: other pairs
/// may go higher, and what is cut off costs more than slightly coarser steps.
constexpr float kHeadroom = 1.1f;

/// Channels narrower than this part of the tensor's widest are treated as that wide: one that was
/// (almost) dead in calibration may wake up.
constexpr double kNarrowest = 1e-3;

using Layers = std::map<std::string, Convolution*>;

std::size_t taps(const Convolution& layer) { return std::size_t(layer.kernel) * layer.kernel; }

/// One output's weights [channel, tap] over input channels first .. first + count - 1.
std::span<float> use_row(Convolution& layer, int out, int first, int count) {
  return std::span(layer.weight)
      .subspan((std::size_t(out) * layer.in_channels + first) * taps(layer), count * taps(layer));
}

/// row·(x + offset + mixing x) over the channels: the weights that read x + guess(x) read x alone.
/// Returns what goes to the bias.
double add_guess(std::span<float> row, std::size_t tap_count, const TensorStatistics& statistics) {
  const std::size_t channels = statistics.offset.size();
  double bias = 0;
  std::vector<float> added(tap_count * channels);  // [tap, channel]; float32 serves a small part
  for (std::size_t from = 0; from < channels; ++from) {
    const float* mixing = &statistics.mixing[from * channels];
    for (std::size_t tap = 0; tap < tap_count; ++tap) {
      const float weight = row[from * tap_count + tap];
      bias += double(weight) * statistics.offset[from];
      float* sums = &added[tap * channels];
      for (std::size_t to = 0; to < channels; ++to) sums[to] += weight * mixing[to];
    }
  }
  for (std::size_t to = 0; to < channels; ++to) {
    for (std::size_t tap = 0; tap < tap_count; ++tap) {
      row[to * tap_count + tap] += added[tap * channels + to];
    }
  }
  return bias;
}

void restore_negative_part(const QuantizedTensor& tensor, const TensorStatistics& statistics,
                           const Layers& layers) {
  for (const TensorUse& use : tensor.uses) {
    Convolution& layer = *layers.at(use.convolution);
    for (int out = 0; out < layer.out_channels; ++out) {
      const auto row = use_row(layer, out, use.first_channel, tensor.channels);
      layer.bias[out] = float(layer.bias[out] + add_guess(row, taps(layer), statistics));
    }
  }
}

std::vector<float> evening_factors(const std::vector<float>& highest) {
  const double widest = *std::ranges::max_element(highest);
  std::vector<float> factors(highest.size(), 1.0f);
  if (!(widest > 0)) return factors;
  for (std::size_t c = 0; c < highest.size(); ++c) {
    factors[c] = float(std::pow(std::max(highest[c] / widest, kNarrowest), kEvenness));
  }
  return factors;
}

/// The producer makes x / factor, the uses read x / factor.
void rescale(const QuantizedTensor& tensor, const std::vector<float>& factors,
             const Layers& layers) {
  Convolution& producer = *layers.at(tensor.producer);
  for (int c = 0; c < tensor.channels; ++c) {
    for (float& weight : use_row(producer, c, 0, producer.in_channels)) weight /= factors[c];
    producer.bias[c] /= factors[c];
  }
  for (const TensorUse& use : tensor.uses) {
    Convolution& layer = *layers.at(use.convolution);
    for (int out = 0; out < layer.out_channels; ++out) {
      for (int c = 0; c < tensor.channels; ++c) {
        for (float& weight : use_row(layer, out, use.first_channel + c, 1)) weight *= factors[c];
      }
    }
  }
}

/// Factors by tensor; those that an addition joins share the factors of the widest of each channel.
std::map<std::string, std::vector<float>> all_factors(const std::vector<QuantizedTensor>& tensors,
                                                      const Calibration& calibration) {
  std::map<std::string, std::string> group;  // tensor → the first of the tensors it is joined with
  std::map<std::string, std::vector<float>> highest;  // by group
  for (std::size_t i = 0; i < tensors.size(); ++i) {
    const QuantizedTensor& tensor = tensors[i];
    group[tensor.name] = tensor.addend.empty() ? tensor.name : group.at(tensor.addend);
    std::vector<float>& joint = highest[group[tensor.name]];
    joint.resize(tensor.channels, 0.0f);
    std::ranges::transform(joint, calibration.tensors[i].highest, joint.begin(),
                           [](float a, float b) { return std::max(a, b); });
  }
  std::map<std::string, std::vector<float>> factors;
  for (const auto& [name, first] : group) factors[name] = evening_factors(highest.at(first));
  return factors;
}

TensorQuantization quantization(const TensorStatistics& statistics,
                                const std::vector<float>& factors) {
  TensorQuantization result;
  float highest = 0;
  for (std::size_t c = 0; c < factors.size(); ++c) {
    highest = std::max(highest, statistics.highest[c] / factors[c]);
    result.mean.push_back(statistics.mean[c] / factors[c]);
  }
  const float scale = kHeadroom * highest / kLargestStored;
  result.scale = std::isnormal(scale) ? scale : 1.0f;  // any will do for a tensor of zeros
  return result;
}

}  // namespace

QuantizableNetwork quantize_network(const Weights& weights, const Calibration& calibration) {
  check_weights(weights, "the weights");
  check_calibration(calibration, weights.base_channels, "the calibration");
  QuantizableNetwork network{weights.convolutions, {}};
  Layers layers;
  for (Convolution& layer : network.convolutions) layers[layer.name] = &layer;

  const std::vector<QuantizedTensor> tensors = quantized_tensors(weights.base_channels);
  const auto factors = all_factors(tensors, calibration);
  for (std::size_t i = 0; i < tensors.size(); ++i) {
    const QuantizedTensor& tensor = tensors[i];
    const TensorStatistics& statistics = calibration.tensors[i];
    if (tensor.leaky) restore_negative_part(tensor, statistics, layers);
    rescale(tensor, factors.at(tensor.name), layers);
    network.tensors[tensor.name] = quantization(statistics, factors.at(tensor.name));
  }
  return network;
}

}  // namespace eventgan
