#include "stages/training/losses/hinge_loss.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/stages/training/losses/loss_cases.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

using testing::golden_tensor;
using testing::random_tensor;
using testing::tensor_of;

TEST(HingeLoss, MatchesGoldenNumbers) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const at::Tensor real = golden_tensor("losses/hinge/real");
  const at::Tensor fake = golden_tensor("losses/hinge/fake");
  EXPECT_NEAR(discriminator_hinge_loss(real, fake).item<double>(),
              golden_tensor("losses/hinge/discriminator").item<double>(), 1e-6);
  EXPECT_NEAR(generator_hinge_loss(fake).item<double>(),
              golden_tensor("losses/hinge/generator").item<double>(), 1e-6);
}

TEST(HingeLoss, CountsOnlyWhatIsOnTheWrongSideOfTheMargin) {
  const at::Tensor real = tensor_of({1, 1, 2, 2}, {-1, 0, 1, 5});  // 2, 1, 0, 0
  const at::Tensor fake = tensor_of({1, 1, 1, 2}, {-3, 0.5f});     // 0, 1.5
  EXPECT_FLOAT_EQ(discriminator_hinge_loss(real, fake).item<float>(), 0.75f + 0.75f);
  EXPECT_FLOAT_EQ(generator_hinge_loss(real).item<float>(), -1.25f);
}

TEST(HingeLoss, IsTwoForADiscriminatorThatKnowsNothing) {
  const at::Tensor logits = tensor_of({2, 1, 1, 1}, {0, 0});
  EXPECT_EQ(discriminator_hinge_loss(logits, logits).item<float>(), 2);
}

TEST(HingeLoss, HasTheGradientOfDifferences) {
  const at::Tensor fixed = random_tensor({2, 1, 3, 2}, 1).mul(2);
  const at::Tensor at = random_tensor({2, 1, 3, 2}, 2).mul(2);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& x) { return discriminator_hinge_loss(x, fixed); }, at);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& x) { return discriminator_hinge_loss(fixed, x); }, at);
  testing::expect_gradient_of_differences(generator_hinge_loss, at);
}

TEST(HingeLoss, LetsNanThrough) {
  const at::Tensor logits = tensor_of({1, 1, 1, 2}, {0, std::numeric_limits<float>::quiet_NaN()});
  EXPECT_TRUE(
      std::isnan(discriminator_hinge_loss(logits, tensor_of({1, 1, 1, 1}, {0})).item<float>()));
  EXPECT_TRUE(std::isnan(generator_hinge_loss(logits).item<float>()));
}

}  // namespace
}  // namespace eventgan
