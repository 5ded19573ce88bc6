#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/training/networks/initialization_internal.h"
#include "stages/training/networks/network_state_internal.h"

namespace eventgan {
namespace {

using ::testing::Each;

template <class Network>
StateDict initialized(Network network, std::uint64_t seed) {
  initialize(*network, seed);
  StateDict state;
  save_network(*network, state, "");
  return state;
}

StateDict generator(std::uint64_t seed) {
  return initialized(UNet(UNetSettings{2, 18, 4, false, SpectralNormPlace::kDecoders}), seed);
}

double deviation(const std::vector<float>& values) {
  double squares = 0;
  for (const float value : values) squares += double(value) * value;
  return std::sqrt(squares / double(values.size()));
}

TEST(Initialize, DrawsConvolutionsAsThePublishedCode) {
  const StateDict state = generator(1);
  // encoders.3: fan_in = 32 · 9, 64 · 288 values: a sample deviation is within 1 % of the true one.
  const double expected = std::sqrt(2.0 / 101 / 288);
  EXPECT_NEAR(deviation(state.at("encoders.3.conv2d.weight").values), expected, 0.02 * expected);
  EXPECT_THAT(state.at("head.conv2d.bias").values, Each(0.0f));
  EXPECT_THAT(state.at("encoders.0.norm_layer.weight").values, Each(1.0f));
  EXPECT_THAT(state.at("encoders.0.norm_layer.bias").values, Each(0.0f));
  EXPECT_THAT(state.at("resblocks.1.bn2.running_mean").values, Each(0.0f));
  EXPECT_THAT(state.at("resblocks.1.bn2.running_var").values, Each(1.0f));
  EXPECT_THAT(state.at("resblocks.1.bn2.num_batches_tracked").values, Each(0.0f));
}

TEST(Initialize, DrawsSpectralNormConvolutionsUniformly) {
  const StateDict state = generator(1);
  const auto& weight = state.at("resblocks.0.conv1.module.weight_bar").values;
  const double limit = 1 / std::sqrt(64.0 * 9);
  EXPECT_LE(*std::max_element(weight.begin(), weight.end()), limit);
  EXPECT_NEAR(deviation(weight), limit / std::sqrt(3.0), 0.02 * limit);
  for (const char* vector : {"weight_u", "weight_v"}) {
    const auto& values = state.at(std::string("decoders.1.conv2d.module.") + vector).values;
    EXPECT_NEAR(deviation(values) * std::sqrt(double(values.size())), 1, 1e-5) << vector;
  }
}

TEST(Initialize, DrawsTheDiscriminatorUniformly) {
  const StateDict state = initialized(PatchDiscriminator(18, 2, 4), 1);
  const double limit = 1 / std::sqrt(32.0 * 16);
  const auto& weight = state.at("disc.model.8.weight").values;
  EXPECT_NEAR(deviation(weight), limit / std::sqrt(3.0), 0.03 * limit);
  for (const float value : state.at("disc.model.8.bias").values) {
    EXPECT_LE(std::abs(value), limit);
    EXPECT_NE(value, 0.0f);
  }
}

TEST(Initialize, IsAFunctionOfSeedAndName) {
  const StateDict first = generator(7), again = generator(7), other = generator(8);
  for (const auto& [key, tensor] : first) EXPECT_EQ(tensor.values, again.at(key).values) << key;
  EXPECT_NE(first.at("head.conv2d.weight").values, other.at("head.conv2d.weight").values);
  EXPECT_NE(first.at("resblocks.0.conv1.module.weight_bar").values,
            first.at("resblocks.0.conv2.module.weight_bar").values);
}

}  // namespace
}  // namespace eventgan
