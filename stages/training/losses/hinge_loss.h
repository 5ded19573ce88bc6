#pragma once

#include <ATen/core/Tensor.h>

namespace eventgan {

// Hinge losses of a GAN (Lim and Ye 2017; Miyato et al. 2018), as the published code has them.
// Logits: [B, 1, h, w] floating point, any size that is not empty, on one device. Results: scalars
// [] that gradients flow through; a NaN passes through. Thread safe.

/// Discriminator: mean(max(0, 1 - real)) + mean(max(0, 1 + fake)), ≥ 0; 2 for logits all 0.
at::Tensor discriminator_hinge_loss(const at::Tensor& real_logits, const at::Tensor& fake_logits);

/// Generator: -mean(logits), `logits` being the discriminator's for generated volumes.
at::Tensor generator_hinge_loss(const at::Tensor& logits);

}  // namespace eventgan
