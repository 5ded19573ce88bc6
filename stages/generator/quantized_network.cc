#include "stages/generator/quantized_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>

#include "stages/generator/calibration.h"

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

/// The step of a tensor in which calibration saw nothing: whatever appears in it later lies beyond
/// its range, and counts as that, rather than being rounded to zero.
constexpr float kStepOfNothing = 0x1p-64f;

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
  result.scale = std::isnormal(scale) ? scale : kStepOfNothing;
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

namespace {

void check_finite(std::span<const float> values, const char* what) {
  if (std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) return;
  throw std::invalid_argument(std::string("expected finite ") + what + ", got NaN or infinity");
}

float largest_magnitude(std::span<const float> values) {
  float largest = 0;
  for (const float value : values) largest = std::max(largest, std::abs(value));
  return largest;
}

/// What one unit of a row's weights stands for. One so small that the scale would not be a normal
/// float counts as a row of zeros.
double weight_step(float largest, int largest_weight, float input_scale) {
  const double step = double(largest) / largest_weight;
  return step * input_scale < std::numeric_limits<float>::min() ? 1 : step;
}

/// An engine adds up the products of one output with stored values of 0..255 in 32 bits, in any
/// order: no sum of some of them may leave those.
void check_sums(std::span<const std::int8_t> row) {
  std::int64_t positive = 0, negative = 0;
  for (const std::int8_t value : row) (value > 0 ? positive : negative) += value;
  const std::int64_t largest = kLargestStored * std::max(positive, -negative);
  if (largest <= std::numeric_limits<std::int32_t>::max()) return;
  throw std::invalid_argument("expected 8-bit sums of at most 2^31 - 1, got up to " +
                              std::to_string(largest) + " from " + std::to_string(row.size()) +
                              " weights: the network is too wide for int8");
}

void check_kernel(std::span<const float> kernel, int out_channels, float input_scale,
                  std::span<const float> input_mean, int largest_weight) {
  if (out_channels < 1 || input_mean.empty() || kernel.empty() ||
      kernel.size() % (out_channels * input_mean.size()) != 0) {
    throw std::invalid_argument("expected a kernel [" + std::to_string(out_channels) + ", " +
                                std::to_string(input_mean.size()) + ", taps], got " +
                                std::to_string(kernel.size()) + " values");
  }
  if (!(input_scale > 0) || !std::isfinite(input_scale)) {
    throw std::invalid_argument("expected an input scale above 0, got " +
                                std::to_string(input_scale));
  }
  if (largest_weight < 1 || largest_weight > kLargestWeight) {
    throw std::invalid_argument("expected a largest weight in 1..127, got " +
                                std::to_string(largest_weight));
  }
  check_finite(kernel, "weights");
  check_finite(input_mean, "means");
}

}  // namespace

QuantizedKernel quantize_kernel(std::span<const float> kernel, int out_channels, float input_scale,
                                std::span<const float> input_mean, int largest_weight) {
  check_kernel(kernel, out_channels, input_scale, input_mean, largest_weight);
  const std::size_t row_size = kernel.size() / out_channels;
  const std::size_t taps = row_size / input_mean.size();
  QuantizedKernel result;
  result.values.resize(kernel.size());
  for (int out = 0; out < out_channels; ++out) {
    const std::span<const float> row = kernel.subspan(out * row_size, row_size);
    const double step = weight_step(largest_magnitude(row), largest_weight, input_scale);
    double correction = 0;
    for (std::size_t i = 0; i < row_size; ++i) {
      // At most largest_weight, since step is largest / largest_weight.
      const double value = std::nearbyint(row[i] / step);
      result.values[out * row_size + i] = static_cast<std::int8_t>(value);
      correction += (row[i] - step * value) * input_mean[i / taps];
    }
    check_sums(std::span(result.values).subspan(out * row_size, row_size));
    result.scales.push_back(static_cast<float>(step * input_scale));
    result.bias_correction.push_back(static_cast<float>(correction));
  }
  check_finite(result.scales, "scales");
  check_finite(result.bias_correction, "corrections");
  return result;
}

}  // namespace eventgan
