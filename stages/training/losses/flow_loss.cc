#include "stages/training/losses/flow_loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/grid_sampler.h>
#include <ATen/ops/linspace.h>
#include <ATen/ops/stack.h>
#include <ATen/ops/upsample_nearest2d.h>
#include <ATen/ops/zeros.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "stages/training/losses/shapes_internal.h"

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

namespace eventgan {
namespace {

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

}  // namespace eventgan
