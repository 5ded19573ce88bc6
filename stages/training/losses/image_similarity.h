#pragma once

#include <ATen/core/Tensor.h>

namespace eventgan {

// How alike two pictures are, with the numbers of the published code. Pictures: [B, 1, H, W], both
// of one type, float32 or float64, in [-1, 1], on one device and outside autocast (bfloat16 has too
// few bits for a variance). Results: scalars [] that gradients flow through; a NaN passes through.
// Throw std::invalid_argument if shapes differ. Thread safe.

/// Structural similarity (Wang et al. 2004), mean over all pixels: 11x11 Gaussian window, σ = 1.5,
/// zeros beyond the edge, constants for pictures in 0..1. At most 1, which equal pictures have.
at::Tensor ssim(const at::Tensor& first, const at::Tensor& second);

/// mean|image - target| - SSIM(image, target); at least -1.
at::Tensor image_loss(const at::Tensor& image, const at::Tensor& target);

}  // namespace eventgan
