#include "stages/generator/untrained.h"

#include <gtest/gtest.h>

#include <cmath>

namespace eventgan {
namespace {

TEST(UntrainedWeights, SameSeedSameNumbers) {
  EXPECT_EQ(untrained_weights(2, 9, 1).convolutions[3].weight,
            untrained_weights(2, 9, 1).convolutions[3].weight);
  EXPECT_NE(untrained_weights(2, 9, 1).convolutions[3].weight,
            untrained_weights(2, 9, 2).convolutions[3].weight);
}

TEST(UntrainedWeights, HaveTheLayoutAndTheDeviationOfHeInitialisation) {
  const Weights weights = untrained_weights(8, 9, 1);
  EXPECT_NO_THROW(check_weights(weights, "test"));
  const Convolution& layer = weights.convolutions[5];  // resblocks.0.conv1: fan-in 128 x 9
  double squares = 0;
  for (const float value : layer.weight) squares += double(value) * value;
  const double deviation = std::sqrt(squares / double(layer.weight.size()));
  // 147,456 samples: the relative error of the deviation is about 1/√(2n) = 0.2 %.
  EXPECT_NEAR(deviation, std::sqrt(2.0 / (128 * 9)), 0.01 * deviation);
}

}  // namespace
}  // namespace eventgan
