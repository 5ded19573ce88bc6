#include "stages/training/learning_rate.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(LearningRate, FallsByHalfACosine) {
  // Half way: (1 + cos(π/2)) / 2 = 1/2, so f + (1 - f) / 2; at a third: cos(π/3) = 1/2, so 3/4.
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 0, 300), 2e-4);
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 100, 300), 2e-4 * (0.1 + 0.9 * 0.75));
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 150, 300), 2e-4 * 0.55);
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 300, 300), 2e-4 * 0.1);
}

TEST(LearningRate, StaysAtItsEndAndWithoutSteps) {
  EXPECT_DOUBLE_EQ(learning_rate(1, 0.25, 1000, 300), 0.25);
  EXPECT_DOUBLE_EQ(learning_rate(1, 0.25, 0, 0), 0.25);
  EXPECT_DOUBLE_EQ(learning_rate(1, 0, 7, 5), 0);
}

TEST(LearningRate, IsConstantAtFractionOne) {
  for (const int step : {0, 1, 49, 50, 51}) EXPECT_DOUBLE_EQ(learning_rate(3, 1, step, 50), 3);
}

}  // namespace
}  // namespace eventgan
