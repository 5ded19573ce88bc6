#include "stages/training/losses/reconstruction_loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/upsample_nearest2d.h>
#include <ATen/ops/zeros.h>

#include <cmath>
#include <stdexcept>

#include "stages/training/losses/image_similarity.h"
#include "stages/training/losses/shapes_internal.h"

namespace eventgan {

at::Tensor multi_scale_reconstruction_loss(const std::vector<at::Tensor>& images,
                                           const at::Tensor& target) {
  if (images.empty())
    throw std::invalid_argument("expected pictures of at least one scale, got none");
  require_sides(target, {-1, 1, -1, -1}, "the picture to reconstruct");
  at::Tensor loss = at::zeros({}, target.options());
  double scale = std::ldexp(1.0, 1 - static_cast<int>(images.size()));
  for (const at::Tensor& image : images) {
    require_sides(image, {target.size(0), 1, -1, -1}, "a reconstructed picture");
    const bool fits = image.sizes() == target.sizes();
    const at::Tensor full =
        fits ? image : at::upsample_nearest2d(image, {target.size(2), target.size(3)});
    loss = loss + scale * image_loss(full, target);
    scale *= 2;
  }
  return loss;
}

}  // namespace eventgan
