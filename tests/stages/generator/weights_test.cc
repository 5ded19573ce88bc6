#include "stages/generator/weights.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/generator/network_shape.h"
#include "stages/generator/untrained.h"

namespace eventgan {
namespace {

TEST(NetworkLayout, HasThePublishedNumberOfParameters) {
  // DESIGN section 4: 13.36 M parameters at base width 32. Folding turns the batch norms' γ and β
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

TEST(NetworkLayout, ScalesWithTheBaseWidth) {
  const auto layout = network_layout(8, 9);
  EXPECT_EQ(layout.size(), 14u);
  EXPECT_EQ(layout.front().out_channels, 8);
  EXPECT_EQ(layout[9].name, "decoders.0");
  EXPECT_EQ(layout[9].in_channels, 192);  // 16 b from below and 8 b from the skip
  EXPECT_EQ(layout.back().out_channels, 18);
}

TEST(HalfSize, RoundsUp) {
  EXPECT_EQ(half_size({260, 861}), (ImageSize{130, 431}));
  EXPECT_EQ(half_size({1, 2}), (ImageSize{1, 1}));
}

TEST(CheckWeights, FindsAMissingLayerAndNan) {
  Weights weights = untrained_weights(1, 9, 1);
  weights.convolutions[2].weight[0] = NAN;
  EXPECT_THROW(check_weights(weights, "test"), std::runtime_error);
  weights = untrained_weights(1, 9, 1);
  weights.convolutions.pop_back();
  EXPECT_THROW(check_weights(weights, "test"), std::runtime_error);
  weights = untrained_weights(1, 9, 1);
  std::swap(weights.convolutions[2], weights.convolutions[3]);
  EXPECT_THROW(check_weights(weights, "test"), std::runtime_error);
}

TEST(ActivationBytes, AddUpTheTensorsBetweenTheLayers) {
  // Base width 2 at 32x48: 2 channels of 32x48, 4 of 16x24, 8 of 8x12, 16 of 4x6, the last three
  // twice, two of 32 channels of 2x3; the frames in float32.
  const std::size_t values = 2 * 1536 + 2 * (4 * 384 + 8 * 96 + 16 * 24) + 2 * 32 * 6;
  EXPECT_EQ(activation_bytes({32, 48}, 2, 4), values * 4 + 2 * 1536 * 4);
  EXPECT_EQ(activation_bytes({32, 48}, 2, 1), values + 2 * 1536 * 4);
}

}  // namespace
}  // namespace eventgan
