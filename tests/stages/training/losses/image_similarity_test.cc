#include "stages/training/losses/image_similarity.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/full.h>
#include <ATen/ops/zeros.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/stages/training/losses/loss_cases.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

using testing::golden_tensor;
using testing::random_tensor;

/// Gaussian-weighted sum of f(y, x) over the 11x11 pixels around one, as far as they exist.
template <typename Function>
double around(int y, int x, int height, int width, const Function& f) {
  double sum = 0, weights = 0;
  for (int dy = -5; dy <= 5; ++dy) {
    for (int dx = -5; dx <= 5; ++dx) {
      const double weight = std::exp(-(dy * dy + dx * dx) / 4.5);
      weights += weight;
      const int row = y + dy, column = x + dx;
      if (row >= 0 && row < height && column >= 0 && column < width) sum += weight * f(row, column);
    }
  }
  return sum / weights;
}

/// The definition, pixel by pixel; [1, 1, H, W] float64.
double ssim_by_definition(const at::Tensor& first, const at::Tensor& second) {
  const int height = static_cast<int>(first.size(2)), width = static_cast<int>(first.size(3));
  const auto a = first.accessor<double, 4>(), b = second.accessor<double, 4>();
  double sum = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto mean = [&](const auto& f) { return around(y, x, height, width, f); };
      const double mean_a = mean([&](int r, int c) { return a[0][0][r][c]; });
      const double mean_b = mean([&](int r, int c) { return b[0][0][r][c]; });
      const double aa = mean([&](int r, int c) { return a[0][0][r][c] * a[0][0][r][c]; });
      const double bb = mean([&](int r, int c) { return b[0][0][r][c] * b[0][0][r][c]; });
      const double ab = mean([&](int r, int c) { return a[0][0][r][c] * b[0][0][r][c]; });
      sum += (2 * mean_a * mean_b + 1e-4) * (2 * (ab - mean_a * mean_b) + 9e-4) /
             ((mean_a * mean_a + mean_b * mean_b + 1e-4) *
              (aa - mean_a * mean_a + bb - mean_b * mean_b + 9e-4));
    }
  }
  return sum / (height * width);
}

// In float32 a variance is the small difference of large numbers: the golden numbers themselves are
// 2e-6 away from what float64 gives.
TEST(Ssim, MatchesGoldenNumbersWithinTheirRounding) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const at::Tensor a = golden_tensor("losses/image/a"), b = golden_tensor("losses/image/b");
  const double similarity = ssim(a, b).item<double>();
  EXPECT_NEAR(similarity, golden_tensor("losses/image/ssim").item<double>(), 4e-6);
  EXPECT_NEAR(image_loss(a, b).item<double>(),
              golden_tensor("losses/image/l1_minus_ssim").item<double>(), 4e-6);
  EXPECT_NEAR(similarity, ssim(a.to(at::kDouble), b.to(at::kDouble)).item<double>(), 2e-6);
}

TEST(Ssim, IsWhatTheDefinitionSays) {
  for (const std::vector<std::int64_t>& shape :
       {std::vector<std::int64_t>{1, 1, 1, 1}, {1, 1, 4, 13}, {1, 1, 17, 5}}) {
    const at::Tensor a = random_tensor(shape, 1);
    const at::Tensor b = 0.5 * a + 0.5 * random_tensor(shape, 2);
    EXPECT_NEAR(ssim(a, b).item<double>(), ssim_by_definition(a, b), 1e-12);
  }
}

TEST(Ssim, IsOneForEqualPictures) {
  const at::Tensor picture = random_tensor({3, 1, 13, 7}, 3).to(at::kFloat);
  EXPECT_NEAR(ssim(picture, picture).item<double>(), 1, 1e-6);
  EXPECT_NEAR(image_loss(picture, picture).item<double>(), -1, 1e-6);
  for (const float grey : {-1.0f, 0.0f, 0.3f, 1.0f}) {
    const at::Tensor constant = at::full({1, 1, 20, 20}, grey);
    EXPECT_NEAR(ssim(constant, constant).item<double>(), 1, 1e-6) << grey;
  }
}

TEST(ImageLoss, IsTheMeanDifferenceLessTheSimilarity) {
  const at::Tensor black = at::zeros({2, 1, 6, 6}, at::kDouble);
  EXPECT_NEAR(image_loss(black + 0.25, black).item<double>(),
              0.25 - ssim(black + 0.25, black).item<double>(), 1e-12);
}

TEST(ImageLoss, HasTheGradientOfDifferences) {
  const at::Tensor target = random_tensor({2, 1, 5, 6}, 4);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& image) { return image_loss(image, target); },
      random_tensor({2, 1, 5, 6}, 5));
}

TEST(ImageLoss, LetsNanThrough) {
  const at::Tensor picture = at::zeros({1, 1, 20, 20});
  at::Tensor spoiled = picture.clone();
  spoiled[0][0][0][0].fill_(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(image_loss(spoiled, picture).item<double>()));
  EXPECT_TRUE(std::isnan(ssim(picture, spoiled).item<double>()));
}

TEST(ImageLoss, RefusesPicturesOfOtherShapes) {
  const at::Tensor pictures = at::zeros({2, 1, 4, 4});
  EXPECT_THROW(image_loss(pictures, at::zeros({1, 1, 4, 4})), std::invalid_argument);
  EXPECT_THROW(ssim(pictures, at::zeros({2, 1, 4, 5})), std::invalid_argument);
  EXPECT_THROW(ssim(at::zeros({2, 3, 4, 4}), at::zeros({2, 3, 4, 4})), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
