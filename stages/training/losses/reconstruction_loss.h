#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

namespace eventgan {

/// Σ_i 2^(i - n + 1) image_loss(images[i], target), i = 0 the coarsest of n ≥ 1 scales.
///
/// `images`: [B, 1, h, w] each, coarse to fine, brought to the target's size by nearest neighbour;
/// `target`: [B, 1, H, W]; else as image_similarity.h says. Throws std::invalid_argument if shapes
/// do not fit. Thread safe.
at::Tensor multi_scale_reconstruction_loss(const std::vector<at::Tensor>& images,
                                           const at::Tensor& target);

}  // namespace eventgan
