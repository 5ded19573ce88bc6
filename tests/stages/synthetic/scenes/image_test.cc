#include "stages/synthetic/scenes/image.h"

#include <gtest/gtest.h>

#include <cmath>

namespace eventgan {
namespace {

TEST(Image, PixelsAreRoundedAndColoursMix) {
  Image image = black_image({2, 3});
  set_pixel(image, 2, 1, {-5, 99.6f, 300});
  const std::size_t last = 3 * (1 * 3 + 2);
  EXPECT_EQ(image.bgr[last], 0);
  EXPECT_EQ(image.bgr[last + 1], 100);
  EXPECT_EQ(image.bgr[last + 2], 255);
  EXPECT_EQ(image.bgr[0], 0);
  const Colour middle = mix({0, 100, 200}, {100, 200, 0}, 0.25f);
  EXPECT_FLOAT_EQ(middle.blue, 25);
  EXPECT_FLOAT_EQ(middle.green, 125);
  EXPECT_FLOAT_EQ(middle.red, 150);
}

TEST(Texture, CellsAreUniformAndTheSameEveryTime) {
  const Texture texture(CounterRandom(3));
  double sum = 0;
  for (int i = -50; i < 50; ++i) {
    for (int j = -50; j < 50; ++j) {
      const float value = texture.cell(i, j);
      ASSERT_GE(value, 0.0f);
      ASSERT_LT(value, 1.0f);
      sum += value;
    }
  }
  // 10,000 uniform values: the mean's standard deviation is 0.29 / 100.
  EXPECT_NEAR(sum / 10000, 0.5, 0.015);
  EXPECT_EQ(texture.cell(-4, 9), Texture(CounterRandom(3)).cell(-4, 9));
  EXPECT_NE(texture.cell(-4, 9), Texture(CounterRandom(4)).cell(-4, 9));
}

TEST(Texture, NoisePassesThroughTheCellsWithoutSteps) {
  const Texture texture(CounterRandom(3));
  EXPECT_EQ(texture.noise(-4, 9), texture.cell(-4, 9));
  float before = texture.noise(-3.0, 0.3);
  bool varies = false;
  for (double x = -3; x < 3; x += 0.01) {
    const float value = texture.noise(x, 0.3);
    // The easing's slope is at most 1.5, and cells differ by less than 1.
    EXPECT_LE(std::abs(value - before), 0.0151f) << x;
    varies = varies || std::abs(value - texture.noise(0, 0.3)) > 0.1f;
    before = value;
  }
  EXPECT_TRUE(varies);
}

}  // namespace
}  // namespace eventgan
