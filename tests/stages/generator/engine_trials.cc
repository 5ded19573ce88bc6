#include "tests/stages/generator/engine_trials.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "manifests/values/counter_random.h"
#include "stages/generator/calibration.h"
#include "stages/generator/onednn/calibrator.h"

namespace eventgan::testing {

std::vector<float> natural_frames(ImageSize size, std::uint64_t seed) {
  constexpr int kWaves = 6;
  const CounterRandom random(seed);
  std::vector<float> frames(2 * size.pixel_count());
  std::size_t i = 0;
  for (int frame = 0; frame < 2; ++frame) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x, ++i) {
        double value = 0.1 * (random.uniform(1000 + i) - 0.5);
        for (int wave = 0; wave < kWaves; ++wave) {
          const double angle = 2 * std::numbers::pi * random.uniform(3 * wave);
          const double pixels = 4 * std::pow(1.8, wave);
          const double along = (x + 2 * frame) * std::cos(angle) + y * std::sin(angle);
          value += 0.3 *
                   std::sin(2 * std::numbers::pi * (along / pixels + random.uniform(3 * wave + 1)));
        }
        // As decoded frames are: 256 levels.
        frames[i] = float(std::round(std::clamp(value, -1.0, 1.0) * 127.5 + 127.5) / 127.5 - 1);
      }
    }
  }
  return frames;
}

std::vector<float> generated(const Generator& generator, const std::vector<float>& frames,
                             ImageSize size) {
  std::vector<float> volume(2 * generator.bins() * size.pixel_count(), -1.0f);
  generator.generate({frames, size}, volume);
  return volume;
}

double relative_error(const std::vector<float>& a, const std::vector<float>& expected) {
  double difference = 0, whole = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += (double(a[i]) - expected[i]) * (double(a[i]) - expected[i]);
    whole += double(expected[i]) * expected[i];
  }
  return difference == 0 ? 0 : std::sqrt(difference / whole);
}

float largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

Weights untrained_sensor_weights(int base_channels, int bins, std::uint64_t seed) {
  Weights weights = untrained_weights(base_channels, bins, seed);
  weights.thresholds = ThresholdRange{0.1, 0.4};
  // The third input's kernels are as large as the others', of numbers of their own.
  Convolution& head = weights.convolutions.front();
  const Convolution more = untrained_weights(base_channels, bins, seed + 1).convolutions.front();
  std::vector<float> kernels;
  for (int out = 0; out < base_channels; ++out) {
    const auto frames = head.weight.cbegin() + out * 2 * 9;
    const auto change = more.weight.cbegin() + out * 2 * 9;
    kernels.insert(kernels.end(), frames, frames + 2 * 9);
    kernels.insert(kernels.end(), change, change + 9);
  }
  head.in_channels = 3;
  head.weight = kernels;
  return weights;
}

std::vector<float> planes_of(const Weights& weights, const std::vector<float>& frames,
                             ImageSize size) {
  std::vector<float> kept;
  const auto planes = network_planes({frames, size}, weights.thresholds, kept);
  return {planes.begin(), planes.end()};
}

Weights calibrated(const Weights& weights, ImageSize size) {
  Calibrator calibrator(weights);
  for (std::uint64_t pair = 0; pair < 4; ++pair) {
    calibrator.add({natural_frames(size, 1000 + pair), size});
  }
  Weights result = weights;
  result.calibration = std::make_shared<Calibration>(calibrator.calibration("tests"));
  return result;
}

Calibration sample_calibration(int base_channels, std::uint64_t seed) {
  Calibration calibration{3, "random numbers", {}};
  for (const QuantizedTensor& tensor : quantized_tensors(base_channels)) {
    const CounterRandom random = CounterRandom(seed).keyed(tensor.name);
    std::uint64_t drawn = 0;
    const auto number = [&] { return float(random.uniform(drawn++)); };
    TensorStatistics& statistics = calibration.tensors.emplace_back();
    statistics.name = tensor.name;
    for (int c = 0; c < tensor.channels; ++c) {
      statistics.highest.push_back(std::pow(10.0f, 3 * number() - 1.5f));
      statistics.mean.push_back(0.3f * number() * statistics.highest.back());
    }
    if (!tensor.leaky) continue;
    for (int c = 0; c < tensor.channels; ++c) statistics.offset.push_back(-0.02f * number());
    for (int i = 0; i < tensor.channels * tensor.channels; ++i) {
      statistics.mixing.push_back(0.04f * number() - 0.02f);
    }
  }
  return calibration;
}

}  // namespace eventgan::testing
