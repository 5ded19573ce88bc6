#include "stages/generator/calibration/quantized_kernel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "manifests/counter_random.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

TEST(QuantizedKernel, RoundsEachOutputByItsOwnLargestWeight) {
  // Two outputs, two inputs, one tap; steps 1/127·1.27 = 0.01 and 0.
  const std::vector<float> kernel = {-1.27f, 0.024f, 0, 0};
  const QuantizedKernel rounded = quantize_kernel(kernel, 2, 0.5f, std::vector<float>{3, 10});
  EXPECT_THAT(rounded.values, ElementsAre(-127, 2, 0, 0));
  EXPECT_THAT(rounded.scales, ElementsAre(::testing::FloatNear(0.005f, 1e-9f), 0.5f));
  // What rounding takes away, 0.004, sees a mean of 10.
  EXPECT_THAT(rounded.bias_correction, ElementsAre(::testing::FloatNear(0.04f, 1e-6f), 0));
}

TEST(QuantizedKernel, RoundsHalvesToEven) {
  const std::vector<float> kernel = {127, 2.5f, 3.5f, -2.5f};
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
  EXPECT_THROW(quantize_kernel(std::vector<float>{largest}, 1, 1000, std::vector<float>{0}),
               std::invalid_argument);
}

TEST(QuantizedKernel, RefusesRowsWhoseSumsMayLeave32Bits) {
  // 2^31 - 1 holds 66,311 products 255 * 127, and no more; of either sign.
  constexpr int kMost = 66311;
  const std::vector<float> mean(kMost + 1, 0.0f);
  for (const float weight : {1.0f, -1.0f}) {
    std::vector<float> kernel(kMost + 1, weight);
    EXPECT_THROW(quantize_kernel(kernel, 1, 1, mean), std::invalid_argument);
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
  EXPECT_THROW(quantize_kernel(kernel, 0, 1, mean), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 3, 1, mean), std::invalid_argument);
  EXPECT_THROW(quantize_kernel({}, 1, 1, mean), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 2, 1, {}), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 2, 0, mean), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 2, nan, mean), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 2, 1, mean, 0), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 2, 1, mean, 128), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(std::vector<float>{1, nan}, 1, 1, mean), std::invalid_argument);
  EXPECT_THROW(quantize_kernel(kernel, 2, 1, std::vector<float>{0, nan}), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
