#include "stages/training/losses.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/avg_pool2d.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/grid_sampler.h>
#include <ATen/ops/linspace.h>
#include <ATen/ops/relu.h>
#include <ATen/ops/stack.h>
#include <ATen/ops/upsample_nearest2d.h>
#include <ATen/ops/zeros.h>
#include <torch/csrc/autograd/custom_function.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace eventgan {
namespace {

/// Throws std::invalid_argument if `tensor` does not have these sides, -1 standing for any that is
/// not 0: else LibTorch would broadcast silently, and a loss compare the wrong samples.
void require_sides(const at::Tensor& tensor, const std::vector<std::int64_t>& sides,
                   const std::string& what) {
  bool fits = tensor.dim() == static_cast<std::int64_t>(sides.size());
  for (std::size_t i = 0; fits && i < sides.size(); ++i) {
    const std::int64_t side = tensor.size(static_cast<std::int64_t>(i));
    fits = sides[i] == -1 ? side > 0 : side == sides[i];
  }
  if (fits) return;
  std::ostringstream message;
  message << "expected shape " << at::IntArrayRef(sides) << ", got " << tensor.sizes() << " ("
          << what << "; -1: any)";
  throw std::invalid_argument(message.str());
}

// The loss is a sum over scales i = 0 (coarsest) .. n - 1 with weights 2^(i - n + 1):
//
//   photometric_i = mean over samples of Σ w ρ(warped - next) / Σ w
//   smoothness_i  = (mean ρ(∂x flow_i) + mean ρ(∂y flow_i)) / 2
//   ρ(e) = (e² + 10⁻¹⁰)^0.45                                       (Charbonnier)
//
// warped(x, y) = previous(x + u, y + v), by bilinear interpolation, 0 outside the frame, with the
// flow brought to the frames' size by nearest neighbour. w is the mask where the place looked up
// counts as inside. ∂x and ∂y are backward differences at the flow's own size, 0 in the first
// column or row, which the mean counts.
//
// Two oddities of the published code are kept, since its networks learned with them:
// - Places run from 0 at the first pixel's centre to 1 at the last one's, but are looked up with 0
//   and 1 at the frame's edges. So a flow of zero shrinks the frame about its middle, by half a
//   pixel at the edges.
// - A place counts as inside when it is in (-1, 1), not (0, 1): left of and above the frame the
//   error against 0 counts.
// One is not: a mask [B, H, W] broadcast there to [B, B, H, W], which weights every sample with the
// sum of the whole batch's masks. To get that, give mask.sum(0, true).

constexpr double kExponent = 0.45;
constexpr double kEpsilonSquared = 1e-10;

at::Tensor charbonnier(const at::Tensor& error) {
  // A power by way of the logarithm: with its gradient a third of the time of pow().
  return (kExponent * (error * error + kEpsilonSquared).log()).exp();
}

/// Places of the pixels, [H, W, 2], x then y, in 0..1.
at::Tensor pixel_places(std::int64_t height, std::int64_t width, const at::TensorOptions& options) {
  const at::Tensor x = at::linspace(0, 1, width, options).expand({height, width});
  const at::Tensor y = at::linspace(0, 1, height, options).unsqueeze(1).expand({height, width});
  return at::stack({x, y}, 2);
}

at::Tensor look_up(const at::Tensor& image, const at::Tensor& places) {
  constexpr int kBilinear = 0;
  constexpr int kZeros = 0;
  // grid_sampler wants the frame's edges at -1 and 1.
  return at::grid_sampler(image, 2 * places - 1, kBilinear, kZeros, /*align_corners=*/false);
}

/// [B, 1, H, W] in the type of `places`: 1 where the place counts as inside.
at::Tensor inside(const at::Tensor& places) {
  const at::Tensor x = places.detach().select(3, 0), y = places.detach().select(3, 1);
  return ((x.abs() < 1) & (y.abs() < 1)).unsqueeze(1).to(places.scalar_type());
}

at::Tensor weighted_mean(const at::Tensor& error, const at::Tensor& weights) {
  // The smallest number keeps 0 / 0 of an empty mask at 0 and changes no other quotient.
  const double smallest = std::numeric_limits<float>::min();
  return ((error * weights).sum({1, 2, 3}) / weights.sum({1, 2, 3}).clamp_min(smallest)).mean();
}

/// Mean of ρ over differences along `side`, the first ones being 0.
at::Tensor roughness(const at::Tensor& flow, std::int64_t side) {
  const std::int64_t length = flow.size(side);
  const at::Tensor difference = flow.narrow(side, 1, length - 1) - flow.narrow(side, 0, length - 1);
  const double firsts = std::pow(kEpsilonSquared, kExponent) / static_cast<double>(length);
  return charbonnier(difference).sum() / flow.numel() + firsts;
}

void check(const at::Tensor& previous, const at::Tensor& next, const std::vector<at::Tensor>& flows,
           const at::Tensor& mask) {
  require_sides(previous, {-1, 1, -1, -1}, "the previous frame");
  const std::int64_t batch = previous.size(0), height = previous.size(2), width = previous.size(3);
  require_sides(next, {batch, 1, height, width}, "the next frame");
  if (flows.empty()) throw std::invalid_argument("expected flow of at least one scale, got none");
  for (const at::Tensor& flow : flows) require_sides(flow, {batch, 2, -1, -1}, "a flow");
  const std::int64_t masks = mask.dim() > 0 && mask.size(0) == 1 ? 1 : batch;
  require_sides(mask, {masks, 1, height, width}, "the flow loss's mask");
}

}  // namespace

FlowLoss multi_scale_flow_loss(const at::Tensor& previous, const at::Tensor& next,
                               const std::vector<at::Tensor>& flows, const at::Tensor& mask) {
  const at::Tensor pixel_mask = mask.dim() == 3 ? mask.unsqueeze(1) : mask;
  check(previous, next, flows, pixel_mask);
  const std::int64_t height = previous.size(2), width = previous.size(3);
  const at::Tensor base = pixel_places(height, width, previous.options());
  const at::Tensor weights = pixel_mask.to(previous.scalar_type());

  FlowLoss loss;
  loss.photometric = at::zeros({}, previous.options());
  loss.smoothness = loss.photometric;
  double scale = std::ldexp(1.0, 1 - static_cast<int>(flows.size()));
  for (const at::Tensor& flow : flows) {
    const bool fits = flow.size(2) == height && flow.size(3) == width;
    const at::Tensor full = fits ? flow : at::upsample_nearest2d(flow, {height, width});
    const at::Tensor places = base + full.permute({0, 2, 3, 1});
    loss.warped = look_up(previous, places);
    const at::Tensor error = charbonnier(loss.warped - next);
    loss.photometric = loss.photometric + scale * weighted_mean(error, inside(places) * weights);
    loss.smoothness = loss.smoothness + scale * 0.5 * (roughness(flow, 3) + roughness(flow, 2));
    scale *= 2;
  }
  return loss;
}

namespace {

// Shifted sums along each axis: with one channel in and out, LibTorch's convolution is ten times
// slower on a CPU. The blur is its own transpose, so it is its own backward pass too.

constexpr int kRadius = 5;
constexpr double kSigma = 1.5;

/// Weights of the distances 0..5, those of both sides summing to 1.
std::array<double, kRadius + 1> window() {
  std::array<double, kRadius + 1> weights;
  double sum = 0;
  for (int distance = 0; distance <= kRadius; ++distance) {
    weights[distance] = std::exp(-distance * distance / (2 * kSigma * kSigma));
    sum += (distance == 0 ? 1 : 2) * weights[distance];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

at::Tensor blur_along(const at::Tensor& images, std::int64_t axis) {
  const auto weights = window();
  const std::int64_t length = images.size(axis);
  at::Tensor result = images * weights[0];
  for (std::int64_t distance = 1; distance <= std::min<std::int64_t>(kRadius, length - 1);
       ++distance) {
    const std::int64_t count = length - distance;
    const double weight = weights[distance];
    result.narrow(axis, 0, count).add_(images.narrow(axis, distance, count), weight);
    result.narrow(axis, distance, count).add_(images.narrow(axis, 0, count), weight);
  }
  return result;
}

class GaussianBlur : public torch::autograd::Function<GaussianBlur> {
 public:
  static at::Tensor forward(torch::autograd::AutogradContext*, const at::Tensor& images) {
    return blur_along(blur_along(images, 2), 3);
  }

  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               torch::autograd::tensor_list gradients) {
    return {forward(context, gradients[0])};
  }
};

/// Images [N, C, H, W], float32 or float64, blurred with the 11x11 Gaussian window of σ = 1.5
/// whose weights sum to 1, zeros beyond the edge. Gradients flow through, once (no second
/// derivatives).
at::Tensor gaussian_blur(const at::Tensor& images) { return GaussianBlur::apply(images); }

// With μ, σ² and σ₁₂ the Gaussian-weighted mean, variance and covariance around a pixel:
//
//   SSIM = (2 μ₁μ₂ + C₁)(2 σ₁₂ + C₂) / ((μ₁² + μ₂² + C₁)(σ₁² + σ₂² + C₂)),  C₁ = 0.01², C₂ = 0.03²
//
// Only the sum of the variances is needed, σ₁² + σ₂² = G * (a² + b²) - μ₁² - μ₂², so four images
// are blurred, not five.

constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

}  // namespace

at::Tensor ssim(const at::Tensor& first, const at::Tensor& second) {
  require_sides(first, {-1, 1, -1, -1}, "an image to compare");
  require_sides(second, first.sizes().vec(), "the image to compare with");
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

at::Tensor multi_scale_reconstruction_loss(const std::vector<at::Tensor>& images,
                                           const at::Tensor& target) {
  if (images.empty())
    throw std::invalid_argument("expected images of at least one scale, got none");
  require_sides(target, {-1, 1, -1, -1}, "the image to reconstruct");
  at::Tensor loss = at::zeros({}, target.options());
  double scale = std::ldexp(1.0, 1 - static_cast<int>(images.size()));
  for (const at::Tensor& image : images) {
    require_sides(image, {target.size(0), 1, -1, -1}, "a reconstructed image");
    const bool fits = image.sizes() == target.sizes();
    const at::Tensor full =
        fits ? image : at::upsample_nearest2d(image, {target.size(2), target.size(3)});
    loss = loss + scale * image_loss(full, target);
    scale *= 2;
  }
  return loss;
}

at::Tensor discriminator_hinge_loss(const at::Tensor& real_logits, const at::Tensor& fake_logits) {
  return at::relu(1 - real_logits).mean() + at::relu(1 + fake_logits).mean();
}

at::Tensor generator_hinge_loss(const at::Tensor& logits) { return -logits.mean(); }

namespace {

at::Tensor quantile_loss(const at::Tensor& generated, const at::Tensor& real, double quantile) {
  const at::Tensor difference = real - generated;
  // 2 max(q d, (q - 1) d) = |d| + (2 q - 1) d
  return (difference.abs() + (2 * quantile - 1) * difference).mean();
}

/// [B, 2 bins, H, W] → [B, 2, H, W]
at::Tensor summed_over_time(const at::Tensor& volume) {
  return volume.reshape({volume.size(0), 2, -1, volume.size(2), volume.size(3)}).sum(2);
}

void require_alike(const at::Tensor& generated, const at::Tensor& real) {
  require_sides(generated, {-1, -1, -1, -1}, "the generated volumes");
  require_sides(real, generated.sizes().vec(), "the real volumes");
}

}  // namespace

at::Tensor volume_loss(const at::Tensor& generated, const at::Tensor& real, double quantile) {
  require_alike(generated, real);
  return quantile_loss(generated, real, quantile);
}

at::Tensor count_loss(const at::Tensor& generated, const at::Tensor& real, double quantile) {
  require_alike(generated, real);
  return quantile_loss(summed_over_time(generated), summed_over_time(real), quantile);
}

at::Tensor overlap_loss(const at::Tensor& generated, const at::Tensor& real) {
  require_alike(generated, real);
  const auto apart = [](const at::Tensor& values, const at::Tensor& target) {
    constexpr double kWhole = 0.25;
    const at::Tensor ours = (values / kWhole).clamp_max(1);
    const at::Tensor truth = target.gt(0).to(ours.scalar_type());
    return 1 - (2 * (ours * truth).sum() + 1) / (ours.sum() + truth.sum() + 1);
  };
  const at::Tensor events = at::relu(generated);
  return apart(events, real) + apart(summed_over_time(events), summed_over_time(real));
}

namespace {

/// λ of a generated volume. Below zero, where an output slope leads, nothing is expected; the
/// gradient is as at zero, where relu has none.
at::Tensor expected_events(const at::Tensor& generated) {
  return at::relu(generated) + (generated - generated.detach()) * generated.le(0);
}

/// Half the deviance of a Poisson process that expects `expected` and has `real`: the mean.
at::Tensor half_deviance(const at::Tensor& expected, const at::Tensor& real) {
  constexpr double kBackground = 1;
  const at::Tensor r = expected + kBackground;
  const at::Tensor n = real + kBackground;
  return (r - n - n * (r.log() - n.log())).mean();
}

/// [B, C, H, W] → [B, C, ceil(H / 8), ceil(W / 8)]
at::Tensor block_sums(const at::Tensor& volume) {
  constexpr int kBlock = 8;
  return at::avg_pool2d(volume, {kBlock, kBlock}, {}, 0, /*ceil_mode=*/true,
                        /*count_include_pad=*/true, /*divisor_override=*/1);
}

}  // namespace

at::Tensor likelihood_loss(const at::Tensor& generated, const at::Tensor& real) {
  require_alike(generated, real);
  return half_deviance(expected_events(generated), real);
}

at::Tensor block_likelihood_loss(const at::Tensor& generated, const at::Tensor& real) {
  require_alike(generated, real);
  return half_deviance(block_sums(expected_events(generated)), block_sums(real));
}

}  // namespace eventgan
