#include "stages/training/losses/image_similarity.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/cat.h>

#include "stages/training/losses/gaussian_blur_internal.h"
#include "stages/training/losses/shapes_internal.h"

// With μ, σ² and σ₁₂ the Gaussian-weighted mean, variance and covariance around a pixel:
//
//   SSIM = (2 μ₁μ₂ + C₁)(2 σ₁₂ + C₂) / ((μ₁² + μ₂² + C₁)(σ₁² + σ₂² + C₂)),  C₁ = 0.01², C₂ = 0.03²
//
// Only the sum of the variances is needed, σ₁² + σ₂² = G * (a² + b²) - μ₁² - μ₂², so four pictures
// are blurred, not five.

namespace eventgan {
namespace {

constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

}  // namespace

at::Tensor ssim(const at::Tensor& first, const at::Tensor& second) {
  require_sides(first, {-1, 1, -1, -1}, "a picture to compare");
  require_sides(second, first.sizes().vec(), "the picture to compare with");
  // Apart, since the backward pass skips it for a target that needs no gradient.
  const at::Tensor mean = gaussian_blur(second);
  const auto blurred =
      gaussian_blur(at::cat({first, first * first + second * second, first * second})).chunk(3);
  const at::Tensor product = blurred[0] * mean;
  const at::Tensor squares = blurred[0] * blurred[0] + mean * mean;
  const at::Tensor variances = blurred[1] - squares;
  const at::Tensor covariance = blurred[2] - product;
  return ((2 * product + kC1) * (2 * covariance + kC2) / ((squares + kC1) * (variances + kC2)))
      .mean();
}

at::Tensor image_loss(const at::Tensor& image, const at::Tensor& target) {
  return (image - target).abs().mean() - ssim(image, target);
}

}  // namespace eventgan
