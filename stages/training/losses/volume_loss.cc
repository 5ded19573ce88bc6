#include "stages/training/losses/volume_loss.h"

#include <ATen/TensorOperators.h>

#include "stages/training/losses/shapes_internal.h"

namespace eventgan {
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

}  // namespace eventgan
