#include "stages/generator/onednn/numbers/layer_numbers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

#include "stages/generator/calibration/quantized_kernel.h"
#include "stages/generator/untrained.h"
#include "tests/stages/generator/calibration/sample_calibration.h"

namespace eventgan {
namespace {

Weights calibrated_weights() {
  Weights weights = untrained_weights(2, 3, 7);
  weights.calibration = std::make_shared<const Calibration>(testing::sample_calibration(2, 1));
  return weights;
}

void expect_whole(const NetworkNumbers& numbers) {
  std::vector<std::string> names;
  for (const LayerNumbers& layer : numbers.layers) {
    names.push_back(layer.name);
    EXPECT_EQ(layer.weight.size(),
              std::size_t(layer.out_channels) * layer.in_channels * layer.kernel * layer.kernel)
        << layer.name;
    EXPECT_TRUE(layer.bias.empty() || layer.bias.size() == std::size_t(layer.out_channels))
        << layer.name;
  }
  EXPECT_EQ(names.size(), 10u + 4u * 4u);
  EXPECT_THAT(names,
              ::testing::IsSupersetOf({"head", "pred", "decoders.0.skip", "decoders.1.phases",
                                       "decoders.2.last_row", "decoders.3.last_column"}));
}

TEST(LayerNumbers, AreWhole) {
  expect_whole(float_numbers(untrained_weights(2, 3, 7)));
  expect_whole(int8_numbers(calibrated_weights(), kLargestWeight));
}

TEST(LayerNumbers, OfInt8AreWholeNumbersOfTheWholeRange) {
  for (const int largest : {kLargestWeight, kLargestWeightWithoutVnni}) {
    for (const LayerNumbers& layer : int8_numbers(calibrated_weights(), largest).layers) {
      if (is_float32_layer(layer.name)) {
        EXPECT_TRUE(layer.output_scales.empty()) << layer.name;
        continue;
      }
      float highest = 0;
      for (const float weight : layer.weight) {
        EXPECT_EQ(weight, std::nearbyint(weight)) << layer.name;
        highest = std::max(highest, std::abs(weight));
      }
      EXPECT_EQ(highest, largest) << layer.name;
      EXPECT_EQ(layer.output_scales.size(), std::size_t(layer.out_channels)) << layer.name;
    }
  }
}

TEST(LayerNumbers, OfInt8NeedACalibration) {
  EXPECT_THROW(int8_numbers(untrained_weights(2, 3, 7), kLargestWeight), std::invalid_argument);
}

TEST(LayerNumbers, OfInt8ThatLeaveFloat32AreRefusedByTheirLayersName) {
  for (const std::size_t layer : {std::size_t{0}, std::size_t{2}, std::size_t{12}}) {
    Weights weights = calibrated_weights();
    weights.convolutions[layer].bias[0] = std::numeric_limits<float>::max();
    try {
      int8_numbers(weights, kLargestWeight);
      ADD_FAILURE() << weights.convolutions[layer].name;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(weights.convolutions[layer].name));
    }
  }
}

}  // namespace
}  // namespace eventgan
