#include "stages/training/losses/reconstruction_loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/zeros.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/training/losses/image_similarity.h"
#include "tests/stages/training/losses/loss_cases.h"

namespace eventgan {
namespace {

using testing::random_tensor;

TEST(ReconstructionLoss, EnlargesAndWeighsScalesByHalves) {
  const at::Tensor target = random_tensor({2, 1, 5, 6}, 1);
  const at::Tensor coarse = random_tensor({2, 1, 1, 1}, 2), middle = random_tensor({2, 1, 5, 2}, 3),
                   fine = random_tensor({2, 1, 5, 6}, 4);
  // Three columns of the target to one of `middle`.
  const at::Tensor enlarged = middle.unsqueeze(4).expand({2, 1, 5, 2, 3}).reshape({2, 1, 5, 6});
  const at::Tensor expected = 0.25 * image_loss(coarse.expand_as(target), target) +
                              0.5 * image_loss(enlarged, target) + image_loss(fine, target);
  EXPECT_NEAR(multi_scale_reconstruction_loss({coarse, middle, fine}, target).item<double>(),
              expected.item<double>(), 1e-12);
  EXPECT_NEAR(multi_scale_reconstruction_loss({target}, target).item<double>(), -1, 1e-12);
}

TEST(ReconstructionLoss, HasTheGradientOfDifferences) {
  const at::Tensor target = random_tensor({1, 1, 5, 3}, 5), fine = random_tensor({1, 1, 5, 3}, 6);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& coarse) {
        return multi_scale_reconstruction_loss({coarse, fine}, target);
      },
      random_tensor({1, 1, 3, 2}, 7));
}

TEST(ReconstructionLoss, RefusesShapesThatDoNotFit) {
  const at::Tensor target = at::zeros({2, 1, 4, 4});
  EXPECT_THROW(multi_scale_reconstruction_loss({}, target), std::invalid_argument);
  EXPECT_THROW(multi_scale_reconstruction_loss({at::zeros({1, 1, 4, 4})}, target),
               std::invalid_argument);
  EXPECT_THROW(multi_scale_reconstruction_loss({target}, target[0]), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
