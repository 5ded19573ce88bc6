#include "stages/generator/weights.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "manifests/values/gaussian_random.h"

namespace eventgan {
namespace {

std::string shape_text(const Convolution& convolution) {
  return convolution.name + " [" + std::to_string(convolution.out_channels) + ", " +
         std::to_string(convolution.in_channels) + ", " + std::to_string(convolution.kernel) +
         ", " + std::to_string(convolution.kernel) + "]";
}

}  // namespace

std::vector<Convolution> network_layout(int base_channels, int bins, int inputs) {
  const int b = base_channels;
  std::vector<Convolution> layout;
  const auto add = [&](std::string name, int out, int in, int kernel, int stride) {
    layout.push_back({std::move(name), out, in, kernel, stride, {}, {}});
  };
  add("head", b, inputs, 3, 1);
  for (int level = 0; level < kNetworkLevels; ++level) {
    add("encoders." + std::to_string(level), b << (level + 1), b << level, 3, 2);
  }
  for (int block = 0; block < kResidualBlocks; ++block) {
    for (const char* part : {".conv1", ".conv2"}) {
      add("resblocks." + std::to_string(block) + part, b << kNetworkLevels, b << kNetworkLevels, 3,
          1);
    }
  }
  for (int level = 0; level < kNetworkLevels; ++level) {
    const int in = b << (kNetworkLevels - level);
    add("decoders." + std::to_string(level), in / 2, in + in / 2, 3, 1);
  }
  add("pred", 2 * bins, b, 1, 1);
  return layout;
}

std::string describe_training_gaps(const std::optional<GapRange>& gaps) {
  if (!gaps) return "training gaps unknown";
  return "trained on gaps " + std::to_string(gaps->first) + "-" + std::to_string(gaps->last);
}

std::span<const float> network_planes(const GeneratorInput& pair,
                                      const std::optional<ThresholdRange>& thresholds,
                                      std::vector<float>& kept) {
  const ContrastThreshold told = pair.threshold.value_or(
      ContrastThreshold{thresholds.value_or(ThresholdRange{1, 1}).geometric_mean()});
  if ((pair.threshold && !thresholds) || !(told.mean > 0 && told.ratio > 0)) {
    throw std::invalid_argument(
        "expected " + std::string(thresholds ? "a contrast threshold above 0" : "none") +
        " for these weights, got a contrast threshold of " + std::to_string(told.mean));
  }
  if (!thresholds) return pair.frames;
  return kept = sensor_input(pair.frames, told);
}

std::size_t activation_bytes(ImageSize size, int base_channels, std::size_t value_bytes) {
  // What the encoders read and the decoders but the last write: levels of half the side and twice
  // the channels, the topmost once, the others twice; and two tensors at the bottleneck.
  const std::size_t top = size.pixel_count() * base_channels * value_bytes;
  return top + 2 * (top / 2 + top / 4 + top / 8) + 2 * (top / 16) +
         2 * size.pixel_count() * sizeof(float);
}

void check_weights(const Weights& weights, const std::string& name) {
  const std::vector<Convolution> layout =
      network_layout(weights.base_channels, weights.bins, weights.inputs());
  if (weights.convolutions.size() != layout.size()) {
    throw std::runtime_error("expected " + std::to_string(layout.size()) + " convolutions, got " +
                             std::to_string(weights.convolutions.size()) + ", in " + name);
  }
  for (std::size_t i = 0; i < layout.size(); ++i) {
    const Convolution& got = weights.convolutions[i];
    const Convolution& want = layout[i];
    const std::size_t count =
        std::size_t(want.out_channels) * want.in_channels * want.kernel * want.kernel;
    if (got.name != want.name || got.out_channels != want.out_channels ||
        got.in_channels != want.in_channels || got.kernel != want.kernel ||
        got.stride != want.stride || got.weight.size() != count ||
        got.bias.size() != std::size_t(want.out_channels)) {
      throw std::runtime_error("expected " + shape_text(want) + ", got " + shape_text(got) +
                               ", in " + name);
    }
    if (!all_finite(got.weight) || !all_finite(got.bias)) {
      throw std::runtime_error("expected finite numbers, got NaN or infinity in " + got.name +
                               ", in " + name);
    }
  }
}

Weights untrained_weights(int base_channels, int bins, std::uint64_t seed) {
  Weights weights{base_channels, bins, network_layout(base_channels, bins), {}, nullptr};
  weights.metadata["origin"] = "untrained, seed " + std::to_string(seed);
  for (Convolution& layer : weights.convolutions) {
    const CounterRandom random = CounterRandom(seed).keyed(layer.name);
    const int fan_in = layer.in_channels * layer.kernel * layer.kernel;
    const double deviation = std::sqrt(2.0 / fan_in);
    layer.weight.resize(std::size_t(layer.out_channels) * fan_in);
    for (std::size_t i = 0; i < layer.weight.size(); ++i) {
      layer.weight[i] = static_cast<float>(gaussian(random, i, deviation));
    }
    layer.bias.assign(layer.out_channels, 0.0f);
  }
  return weights;
}

}  // namespace eventgan
