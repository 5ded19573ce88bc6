#include "stages/generator/quantized_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "manifests/values/counter_random.h"
#include "stages/generator/calibration.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/stages/generator/plain_network.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

TEST(QuantizedKernel, RoundsEachOutputByItsOwnLargestWeightHalvesToEven) {
  // Two outputs, two inputs, one tap; steps 1/127·1.27 = 0.01 and 0.
  std::vector<float> kernel = {-1.27f, 0.024f, 0, 0};
  const QuantizedKernel rounded = quantize_kernel(kernel, 2, 0.5f, std::vector<float>{3, 10});
  EXPECT_THAT(rounded.values, ElementsAre(-127, 2, 0, 0));
  EXPECT_THAT(rounded.scales, ElementsAre(::testing::FloatNear(0.005f, 1e-9f), 0.5f));
  // What rounding takes away, 0.004, sees a mean of 10.
  EXPECT_THAT(rounded.bias_correction, ElementsAre(::testing::FloatNear(0.04f, 1e-6f), 0));
  kernel = {127, 2.5f, 3.5f, -2.5f};
  EXPECT_THAT(quantize_kernel(kernel, 1, 1, std::vector<float>{0}).values,
              ElementsAre(127, 2, 4, -2));
}

TEST(QuantizedKernel, IsExactOnItsOwnGrid) {
  const CounterRandom random(4);
  std::vector<float> kernel;
  for (int i = 0; i < 3 * 2 * 4; ++i) {
    kernel.push_back(i % 8 == 0 ? 127.0f : std::floor(float(random.uniform(i)) * 254 - 127));
  }
  const QuantizedKernel rounded = quantize_kernel(kernel, 3, 1, std::vector<float>{5, 7});
  EXPECT_EQ(std::vector<float>(rounded.values.begin(), rounded.values.end()), kernel);
  EXPECT_THAT(rounded.scales, ElementsAre(1, 1, 1));
  EXPECT_THAT(rounded.bias_correction, ElementsAre(0, 0, 0));
}

TEST(QuantizedKernel, ASmallerLargestWeightKeepsPairSumsIn16Bits) {
  const QuantizedKernel rounded = quantize_kernel(std::vector<float>{3, 3, -3, 1}, 1, 1,
                                                  std::vector<float>{0}, kLargestWeightWithoutVnni);
  EXPECT_THAT(rounded.values, ElementsAre(64, 64, -64, 21));
  EXPECT_LE(255 * (rounded.values[0] + rounded.values[1]),
            std::numeric_limits<std::int16_t>::max());
}

TEST(QuantizedKernel, TakesTheSmallestAndLargestNumbers) {
  const float smallest = std::numeric_limits<float>::denorm_min();
  const float largest = std::numeric_limits<float>::max();
  const QuantizedKernel rounded =
      quantize_kernel(std::vector<float>{smallest, 0, largest, 1}, 2, 1, std::vector<float>{0, 0});
  EXPECT_THAT(rounded.values, ElementsAre(0, 0, 127, 0));
  EXPECT_THAT(rounded.scales, ElementsAre(1, largest / 127));
  EXPECT_THROWS(quantize_kernel(std::vector<float>{largest}, 1, 1000, std::vector<float>{0}),
                std::invalid_argument, "expected finite scales, got NaN or infinity");
}

TEST(QuantizedKernel, RefusesRowsWhoseSumsMayLeave32Bits) {
  // 2^31 - 1 holds 66,311 products 255 * 127, and no more; of either sign.
  constexpr int kMost = 66311;
  const std::vector<float> mean(kMost + 1, 0.0f);
  for (const float weight : {1.0f, -1.0f}) {
    std::vector<float> kernel(kMost + 1, weight);
    EXPECT_THROWS(quantize_kernel(kernel, 1, 1, mean), std::invalid_argument,
                  "expected 8-bit sums of at most 2^31 - 1, got up to");
    EXPECT_NO_THROW(quantize_kernel(kernel, 1, 1, mean, kLargestWeightWithoutVnni));
    kernel[5] = 0;
    EXPECT_NO_THROW(quantize_kernel(kernel, 1, 1, mean));
    kernel[5] = -weight;  // no order of adding up reaches further than one sign's products
    EXPECT_NO_THROW(quantize_kernel(kernel, 1, 1, mean));
  }
}

TEST(QuantizedKernel, RefusesWhatIsNoKernel) {
  const std::vector<float> mean = {0, 0};
  const std::vector<float> kernel = {1, 2, 3, 4};
  const float nan = std::nanf("");
  EXPECT_THROWS(quantize_kernel(kernel, 0, 1, mean), std::invalid_argument,
                "expected a kernel [0, 2, taps], got 4 values");
  EXPECT_THROWS(quantize_kernel(kernel, 3, 1, mean), std::invalid_argument,
                "expected a kernel [3, 2, taps], got 4 values");
  EXPECT_THROWS(quantize_kernel({}, 1, 1, mean), std::invalid_argument,
                "expected a kernel [1, 2, taps], got 0 values");
  EXPECT_THROWS(quantize_kernel(kernel, 2, 1, {}), std::invalid_argument,
                "expected a kernel [2, 0, taps], got 4 values");
  EXPECT_THROWS(quantize_kernel(kernel, 2, 0, mean), std::invalid_argument,
                "expected an input scale above 0, got 0.000000");
  EXPECT_THROWS(quantize_kernel(kernel, 2, nan, mean), std::invalid_argument,
                "expected an input scale above 0, got nan");
  EXPECT_THROWS(quantize_kernel(kernel, 2, 1, mean, 0), std::invalid_argument,
                "expected a largest weight in 1..127, got 0");
  EXPECT_THROWS(quantize_kernel(kernel, 2, 1, mean, 128), std::invalid_argument,
                "expected a largest weight in 1..127, got 128");
  EXPECT_THROWS(quantize_kernel(std::vector<float>{1, nan}, 1, 1, mean), std::invalid_argument,
                "expected finite weights, got NaN or infinity");
  EXPECT_THROWS(quantize_kernel(kernel, 2, 1, std::vector<float>{0, nan}), std::invalid_argument,
                "expected finite means, got NaN or infinity");
}

constexpr ImageSize kSize{17, 22};

std::vector<float> random_frames() {
  const CounterRandom random(5);
  std::vector<float> frames(2 * kSize.pixel_count());
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = float(random.uniform(i) * 2 - 1);
  return frames;
}

/// Weights with biases, which untrained ones lack.
Weights weights_with_biases() {
  Weights weights = untrained_weights(2, 3, 7);
  const CounterRandom random(8);
  std::uint64_t drawn = 0;
  for (Convolution& layer : weights.convolutions) {
    for (float& bias : layer.bias) bias = float(random.uniform(drawn++) * 0.2 - 0.1);
  }
  return weights;
}

Weights with(const Weights& weights, const QuantizableNetwork& network) {
  Weights changed = weights;
  changed.convolutions = network.convolutions;
  return changed;
}

void expect_same_volume(const Weights& a, const testing::TensorChange& change_a, const Weights& b,
                        const testing::TensorChange& change_b) {
  const auto one = testing::plain_network(a, random_frames(), kSize, change_a);
  const auto other = testing::plain_network(b, random_frames(), kSize, change_b);
  const float largest = *std::ranges::max_element(one);
  ASSERT_GT(largest, 0);
  for (std::size_t i = 0; i < one.size(); ++i) ASSERT_NEAR(one[i], other[i], 1e-5f * largest);
}

TEST(QuantizeNetwork, EveningTheRangesLeavesTheNetworkAsItIs) {
  const Weights weights = weights_with_biases();
  Calibration calibration = testing::sample_calibration(2, 1);
  for (TensorStatistics& statistics : calibration.tensors) {
    std::ranges::fill(statistics.offset, 0.0f);
    std::ranges::fill(statistics.mixing, 0.0f);
  }
  const QuantizableNetwork network = quantize_network(weights, calibration);
  EXPECT_NE(network.convolutions[1].weight, weights.convolutions[1].weight);
  expect_same_volume(weights, {}, with(weights, network), {});
}

TEST(QuantizeNetwork, TheWeightsMakeUpForTheNegativePart) {
  // A network whose stored tensors lose their negative part and are given the guess, against the
  // changed weights on tensors that only lose it. The offset enters at the padding too, so here 0.
  const Weights weights = weights_with_biases();
  Calibration calibration = testing::sample_calibration(2, 1);
  for (TensorStatistics& statistics : calibration.tensors) {
    std::ranges::fill(statistics.offset, 0.0f);
    std::ranges::fill(statistics.highest, 1.0f);  // no evening
    // The residual addition reads the tensor as it is stored.
    if (statistics.name == "encoders.3") std::ranges::fill(statistics.mixing, 0.0f);
  }
  const auto lose = [](const std::string& name, std::vector<double>& values) {
    if (name == "decoders.3") return;
    for (double& value : values) value = std::max(value, 0.0);
  };
  const auto lose_and_guess = [&](const std::string& name, std::vector<double>& values) {
    lose(name, values);
    const auto found = std::ranges::find(calibration.tensors, name, &TensorStatistics::name);
    if (found == calibration.tensors.end()) return;
    const std::size_t channels = found->offset.size();
    const std::vector<double> kept = values;
    for (std::size_t c = 0; c < channels; ++c) {
      const std::size_t plane = values.size() / channels;
      for (std::size_t k = 0; k < channels; ++k) {
        for (std::size_t i = 0; i < plane; ++i) {
          values[c * plane + i] += double(found->mixing[c * channels + k]) * kept[k * plane + i];
        }
      }
    }
  };
  expect_same_volume(weights, lose_and_guess, with(weights, quantize_network(weights, calibration)),
                     lose);
}

TEST(QuantizeNetwork, TheOffsetGoesThroughTheWeightsToTheBias) {
  const Weights weights = weights_with_biases();
  Calibration calibration = testing::sample_calibration(2, 1);
  for (TensorStatistics& statistics : calibration.tensors) {
    std::ranges::fill(statistics.mixing, 0.0f);
    std::ranges::fill(statistics.highest, 1.0f);
  }
  const QuantizableNetwork network = quantize_network(weights, calibration);
  // decoders.3 ← [decoders.2 (4 channels), head (2)]
  const Convolution& before = weights.convolutions[12];
  const Convolution& after = network.convolutions[12];
  ASSERT_EQ(before.name, "decoders.3");
  const auto& decoder = calibration.tensors[11].offset;
  const auto& head = calibration.tensors[0].offset;
  for (int out = 0; out < before.out_channels; ++out) {
    double bias = before.bias[out];
    for (int in = 0; in < 6; ++in) {
      for (int tap = 0; tap < 9; ++tap) {
        bias +=
            double(before.weight[(out * 6 + in) * 9 + tap]) * (in < 4 ? decoder[in] : head[in - 4]);
      }
    }
    EXPECT_NEAR(after.bias[out], bias, 1e-6);
  }
  EXPECT_EQ(after.weight, before.weight);
}

TEST(QuantizeNetwork, TheStepsReachATenthBeyondTheHighestValue) {
  const Weights weights = weights_with_biases();
  const Calibration calibration = testing::sample_calibration(2, 1);
  const QuantizableNetwork network = quantize_network(weights, calibration);
  EXPECT_EQ(network.tensors.size(), 12u);
  // Not joined with others: factors are the square roots of the ranges' ratios.
  const TensorStatistics& head = calibration.tensors[0];
  const float widest = std::max(head.highest[0], head.highest[1]);
  const TensorQuantization& stored = network.tensors.at("head");
  EXPECT_NEAR(stored.scale * 255, 1.1 * widest, 1e-5 * widest);
  for (int c : {0, 1}) {
    EXPECT_NEAR(stored.mean[c], head.mean[c] / std::sqrt(head.highest[c] / widest), 1e-5 * widest);
  }
}

TEST(QuantizeNetwork, DeadTensorsHaveNoRoomAndDeadChannelsAreHarmless) {
  const Weights weights = weights_with_biases();
  Calibration calibration = testing::sample_calibration(2, 1);
  for (const std::size_t dead : {0, 4, 6, 8}) {
    std::ranges::fill(calibration.tensors[dead].highest, 0.0f);
    std::ranges::fill(calibration.tensors[dead].mean, 0.0f);
  }
  for (const std::size_t partly : {1, 5, 9}) calibration.tensors[partly].highest[0] = 0;
  const QuantizableNetwork network = quantize_network(weights, calibration);
  EXPECT_NO_THROW(check_weights(with(weights, network), "the network"));
  for (const auto& [name, tensor] : network.tensors) {
    EXPECT_GT(tensor.scale, 0) << name;
    EXPECT_TRUE(std::isfinite(tensor.scale)) << name;
  }
  // 255 steps of 2^-64 are 1.4e-17: what is more is clipped, and counted.
  EXPECT_EQ(network.tensors.at("head").scale, 0x1p-64f);
}

TEST(QuantizeNetwork, RefusesACalibrationOfAnotherNetwork) {
  EXPECT_THROWS(quantize_network(untrained_weights(2, 3, 7), testing::sample_calibration(1, 1)),
                std::runtime_error, "expected 2 values for head, got 1, in the calibration");
}

}  // namespace
}  // namespace eventgan
