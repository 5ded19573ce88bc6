#include "stages/generator/weights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "manifests/values/counter_random.h"
#include "stages/generator/decoder_kernels.h"
#include "stages/generator/generator.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(NetworkLayout, HasThePublishedNumberOfParameters) {
  // As published: 13.36 M parameters at base width 32. Folding turns the batch norms' γ and β
  // into one bias for each channel; the published count has γ, β for every channel but those of
  // head and pred.
  std::size_t weights = 0, biases = 0, normalised = 0;
  for (const Convolution& layer : network_layout(32, 9)) {
    weights += std::size_t(layer.out_channels) * layer.in_channels * layer.kernel * layer.kernel;
    biases += layer.out_channels;
    if (layer.name != "head" && layer.name != "pred") normalised += layer.out_channels;
  }
  EXPECT_NEAR(double(weights + biases + normalised) / 1e6, 13.36, 0.005);
}

TEST(NetworkLayout, ScalesWithTheBaseWidthAndOfThreeInputsHasAnotherHead) {
  const auto layout = network_layout(8, 9);
  EXPECT_EQ(layout.size(), 14u);
  EXPECT_EQ(layout.front().out_channels, 8);
  EXPECT_EQ(layout[9].name, "decoders.0");
  EXPECT_EQ(layout[9].in_channels, 192);  // 16 b from below and 8 b from the skip
  EXPECT_EQ(layout.back().out_channels, 18);
  const auto two = network_layout(8, 9), three = network_layout(8, 9, 3);
  EXPECT_EQ(two.front().in_channels, 2);
  EXPECT_EQ(three.front().in_channels, 3);
  ASSERT_EQ(three.size(), two.size());
  for (std::size_t i = 1; i < two.size(); ++i) {
    EXPECT_EQ(three[i].name, two[i].name);
    EXPECT_EQ(three[i].in_channels, two[i].in_channels) << two[i].name;
  }
}

TEST(NetworkPlanes, AreTheFramesThemselvesWithoutThresholds) {
  const std::vector<float> frames(2 * 6, 0.5f);
  std::vector<float> kept;
  const auto planes = network_planes({frames, {2, 3}}, std::nullopt, kept);
  EXPECT_EQ(planes.data(), frames.data());
  EXPECT_EQ(planes.size(), frames.size());
  EXPECT_TRUE(kept.empty());
}

TEST(NetworkPlanes, AreTheSensorsInputOfTheThresholdThatIsToldOrTheMiddleOne) {
  const std::vector<float> frames{-0.5f, 0.25f, 0.5f, -0.75f};
  const ThresholdRange range{0.1, 0.4};
  const auto planes = [&](std::optional<ContrastThreshold> told) {
    std::vector<float> kept;
    const auto seen = network_planes({frames, {1, 2}, told}, range, kept);
    EXPECT_EQ(seen.data(), kept.data());
    return std::vector<float>(seen.begin(), seen.end());
  };
  EXPECT_EQ(planes(std::nullopt), sensor_input(frames, {range.geometric_mean()}));
  EXPECT_EQ(planes(ContrastThreshold{0.3, 2}), sensor_input(frames, {0.3, 2}));
  // What the weights have not learnt is for those who choose it to refuse.
  EXPECT_EQ(planes(ContrastThreshold{4}), sensor_input(frames, {4}));
}

TEST(NetworkPlanes, RefuseAThresholdThatIsNoneOrThatNobodyLearnt) {
  const std::vector<float> frames(2 * 6);
  std::vector<float> kept;
  const auto planes = [&](ContrastThreshold told, std::optional<ThresholdRange> range) {
    network_planes({frames, {2, 3}, told}, range, kept);
  };
  for (const ContrastThreshold wrong :
       {ContrastThreshold{0}, {-0.2}, {NAN}, {0.2, 0}, {0.2, -1}, {0.2, NAN}}) {
    EXPECT_THROWS(planes(wrong, ThresholdRange{0.1, 0.4}), std::invalid_argument,
                  "expected a contrast threshold above 0")
        << wrong.mean << " " << wrong.ratio;
  }
  EXPECT_THROWS(planes({0.2}, std::nullopt), std::invalid_argument, "expected none");
}

TEST(HalfSize, RoundsUp) {
  EXPECT_EQ(half_size({260, 861}), (ImageSize{130, 431}));
  EXPECT_EQ(half_size({1, 2}), (ImageSize{1, 1}));
}

TEST(CheckWeights, FindsAMissingLayerAndNan) {
  Weights weights = untrained_weights(1, 9, 1);
  weights.convolutions[2].weight[0] = NAN;
  EXPECT_THROWS(check_weights(weights, "test"), std::runtime_error,
                "expected finite numbers, got NaN or infinity in encoders.1");
  weights = untrained_weights(1, 9, 1);
  weights.convolutions.pop_back();
  EXPECT_THROWS(check_weights(weights, "test"), std::runtime_error,
                "expected 14 convolutions, got 13, in test");
  weights = untrained_weights(1, 9, 1);
  std::swap(weights.convolutions[2], weights.convolutions[3]);
  EXPECT_THROWS(check_weights(weights, "test"), std::runtime_error,
                "expected encoders.1 [4, 2, 3, 3], got encoders.2 [8, 4, 3");
}

TEST(CheckWeights, WantsAsManyInputsAsTheThresholdsSay) {
  Weights weights = testing::untrained_sensor_weights(2, 3, 1);
  EXPECT_EQ(weights.inputs(), 3);
  EXPECT_NO_THROW(check_weights(weights, "test"));
  weights.thresholds.reset();
  EXPECT_EQ(weights.inputs(), 2);
  EXPECT_THROWS(check_weights(weights, "test"), std::runtime_error,
                "expected head [2, 2, 3, 3], got head [2, 3, 3, 3], in test");
  weights = untrained_weights(2, 3, 1);
  weights.thresholds = ThresholdRange{0.1, 0.4};
  EXPECT_THROWS(check_weights(weights, "test"), std::runtime_error,
                "expected head [2, 3, 3, 3], got head [2, 2, 3, 3], in test");
}

TEST(ActivationBytes, AddUpTheTensorsBetweenTheLayers) {
  // Base width 2 at 32x48: 2 channels of 32x48, 4 of 16x24, 8 of 8x12, 16 of 4x6, the last three
  // twice, two of 32 channels of 2x3; the frames in float32.
  const std::size_t values = 2 * 1536 + 2 * (4 * 384 + 8 * 96 + 16 * 24) + 2 * 32 * 6;
  EXPECT_EQ(activation_bytes({32, 48}, 2, 4), values * 4 + 2 * 1536 * 4);
  EXPECT_EQ(activation_bytes({32, 48}, 2, 1), values + 2 * 1536 * 4);
}

TEST(UntrainedWeights, OfTheSameSeedAreTheSameNumbersInTheLayout) {
  EXPECT_EQ(untrained_weights(2, 9, 1).convolutions[3].weight,
            untrained_weights(2, 9, 1).convolutions[3].weight);
  EXPECT_NE(untrained_weights(2, 9, 1).convolutions[3].weight,
            untrained_weights(2, 9, 2).convolutions[3].weight);
  const Weights weights = untrained_weights(8, 9, 1);
  EXPECT_NO_THROW(check_weights(weights, "test"));
  const Convolution& layer = weights.convolutions[5];  // resblocks.0.conv1: fan-in 128 x 9
  double squares = 0;
  for (const float value : layer.weight) squares += double(value) * value;
  const double deviation = std::sqrt(squares / double(layer.weight.size()));
  // 147,456 samples: the relative error of the deviation is about 1/√(2n) = 0.2 %.
  EXPECT_NEAR(deviation, std::sqrt(2.0 / (128 * 9)), 0.01 * deviation);
}

TEST(CheckGeneratorSpans, TakesFramesAndVolumeOfOneSizeAlone) {
  const std::vector<float> frames(2 * 6), volume(18 * 6);
  EXPECT_NO_THROW(check_generator_spans({frames, {2, 3}}, volume, 9));
  EXPECT_THROWS(check_generator_spans({frames, {3, 3}}, volume, 9), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of 3x3");
  EXPECT_THROWS(check_generator_spans({frames, {2, 3}}, volume, 8), std::invalid_argument,
                "expected frames [2, H, W] and a volume [16, H, W] of 3x2");
  EXPECT_THROWS(check_generator_spans({}, {}, 9), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of 0x0");
  EXPECT_THROWS(check_generator_spans({frames, {-2, -3}}, volume, 9), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of -3x-2");
}

constexpr int kOut = 2;
constexpr int kIn = 3;

std::vector<float> random_values(std::size_t count, std::uint64_t seed) {
  const CounterRandom random(seed);
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = float(random.uniform(i) * 2 - 1);
  return values;
}

/// Value of channel c at (y, x) of an image [channel, y, x]; 0 beyond it.
double at(const std::vector<float>& image, int height, int width, int c, int y, int x) {
  if (y < 0 || x < 0 || y >= height || x >= width) return 0;
  return image[(static_cast<std::size_t>(c) * height + y) * width + x];
}

TEST(PhaseKernel, EqualsTheConvolutionOfTheDoubledImage) {
  const int height = 4, width = 5;
  const auto kernel = random_values(kOut * kIn * 9, 1);
  const auto small = random_values(kIn * height * width, 2);
  const auto phases = phase_kernel(kernel, kOut, kIn);
  ASSERT_EQ(phases.size(), 4u * kOut * kIn * 4);

  for (int o = 0; o < kOut; ++o) {
    for (int y = 0; y < 2 * height; ++y) {
      for (int x = 0; x < 2 * width; ++x) {
        double direct = 0, phased = 0;
        for (int c = 0; c < kIn; ++c) {
          for (int t = 0; t < 9; ++t) {
            const int v = y + t / 3 - 1, u = x + t % 3 - 1;
            const bool inside = v >= 0 && u >= 0 && v < 2 * height && u < 2 * width;
            if (inside)
              direct += kernel[(o * kIn + c) * 9 + t] * at(small, height, width, c, v / 2, u / 2);
          }
          const int channel = (2 * (y % 2) + x % 2) * kOut + o;
          const int p = (y + 1) / 2, q = (x + 1) / 2;
          for (int t = 0; t < 4; ++t) {
            phased += phases[(channel * kIn + c) * 4 + t] *
                      at(small, height, width, c, p - 1 + t / 2, q - 1 + t % 2);
          }
        }
        EXPECT_NEAR(phased, direct, 1e-5) << o << " " << y << " " << x;
      }
    }
  }
}

TEST(DecoderKernels, SplitsTheInputChannels) {
  Convolution decoder{
      "decoders.3", kOut, kIn + kOut, 3, 1, random_values(kOut * (kIn + kOut) * 9, 3), {0, 0}};
  const DecoderKernels kernels = decoder_kernels(decoder);
  EXPECT_EQ(kernels.doubled_channels, kIn);
  ASSERT_EQ(kernels.doubled.size(), kOut * kIn * 9u);
  ASSERT_EQ(kernels.skip.size(), kOut * kOut * 9u);
  const auto weight = [&](int o, int c, int t) {
    return decoder.weight[(o * (kIn + kOut) + c) * 9 + t];
  };
  for (int o = 0; o < kOut; ++o) {
    for (int t = 0; t < 9; ++t) {
      for (int c = 0; c < kIn; ++c) {
        EXPECT_EQ(kernels.doubled[(o * kIn + c) * 9 + t], weight(o, c, t));
        EXPECT_EQ(kernels.transposed[(o * kIn + c) * 9 + t % 3 * 3 + t / 3], weight(o, c, t));
      }
      for (int c = 0; c < kOut; ++c) {
        EXPECT_EQ(kernels.skip[(o * kOut + c) * 9 + t], weight(o, kIn + c, t));
      }
    }
  }
}

}  // namespace
}  // namespace eventgan
