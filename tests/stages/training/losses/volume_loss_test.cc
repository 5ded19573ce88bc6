#include "stages/training/losses/volume_loss.h"

#include <ATen/ops/ones.h>
#include <ATen/ops/zeros.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/stages/training/losses/loss_cases.h"

namespace eventgan {
namespace {

using testing::random_tensor;
using testing::tensor_of;

TEST(VolumeLoss, IsTheMeanDifference) {
  const at::Tensor generated = tensor_of({1, 2, 1, 2}, {0, 1, 0.5f, 0.25f});
  const at::Tensor real = tensor_of({1, 2, 1, 2}, {1, 1, 0, 0.75f});
  EXPECT_FLOAT_EQ(volume_loss(generated, real, 0.5).item<float>(),
                  0.5f);  // (1 + 0 + 1/2 + 1/2) / 4
  EXPECT_EQ(volume_loss(real, real, 0.8).item<float>(), 0);
}

TEST(VolumeLoss, CountsAMissedEventAsTheQuantileSays) {
  const at::Tensor empty = at::zeros({1, 2, 1, 2});
  const at::Tensor full = at::ones({1, 2, 1, 2});
  EXPECT_FLOAT_EQ(volume_loss(empty, full, 0.8).item<float>(), 1.6f);  // 2 q
  EXPECT_FLOAT_EQ(volume_loss(full, empty, 0.8).item<float>(), 0.4f);  // 2 (1 - q)
}

TEST(CountLoss, DoesNotAskWhenTheEventsCame) {
  // Two bins of positive, two of negative polarity, one pixel.
  const at::Tensor early = tensor_of({1, 4, 1, 1}, {1, 0, 0, 0.5f});
  const at::Tensor late = tensor_of({1, 4, 1, 1}, {0, 1, 0.5f, 0});
  const at::Tensor swapped = tensor_of({1, 4, 1, 1}, {0, 0.5f, 1, 0});
  EXPECT_EQ(count_loss(early, late, 0.5).item<float>(), 0);
  EXPECT_FLOAT_EQ(count_loss(early, swapped, 0.5).item<float>(), 0.5f);  // |1 - .5|, |.5 - 1|
}

TEST(CountLoss, HasTheGradientOfDifferences) {
  const at::Tensor real = random_tensor({2, 4, 3, 2}, 3);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& generated) { return count_loss(generated, real, 0.7); },
      random_tensor({2, 4, 3, 2}, 4));
}

TEST(VolumeLoss, HasTheGradientOfDifferences) {
  const at::Tensor real = random_tensor({2, 4, 3, 2}, 1);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& generated) { return volume_loss(generated, real, 0.7); },
      random_tensor({2, 4, 3, 2}, 2));
}

TEST(VolumeLoss, LetsNanThrough) {
  const at::Tensor nan = tensor_of({1, 1, 1, 1}, {std::numeric_limits<float>::quiet_NaN()});
  EXPECT_TRUE(std::isnan(volume_loss(nan, at::zeros({1, 1, 1, 1}), 0.5).item<float>()));
}

TEST(VolumeLoss, RefusesOtherShapesAndSaysWhich) {
  try {
    volume_loss(at::zeros({2, 18, 4, 5}), at::zeros({1, 18, 4, 5}), 0.5);
    FAIL() << "expected std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(),
                 "expected shape [2, 18, 4, 5], got [1, 18, 4, 5] (the real volumes; -1: any)");
  }
  EXPECT_THROW(volume_loss(at::zeros({0, 18, 4, 5}), at::zeros({0, 18, 4, 5}), 0.5),
               std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
