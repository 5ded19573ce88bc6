#include "stages/generator/weights.h"

#include <gtest/gtest.h>

#include <cmath>

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

}  // namespace
}  // namespace eventgan
