#pragma once

#include <ATen/core/Tensor.h>

namespace eventgan {

/// Pictures [N, C, H, W], float32 or float64, blurred with the 11x11 Gaussian window of σ = 1.5
/// whose weights sum to 1, zeros beyond the edge. Gradients flow through, once (no second
/// derivatives).
at::Tensor gaussian_blur(const at::Tensor& pictures);

}  // namespace eventgan
