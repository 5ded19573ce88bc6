#pragma once

#include <ATen/core/Tensor.h>

namespace eventgan {

// A direct pull towards the real volume, not in the paper: for trainings too short for the others.
// Both are means of the quantile loss (Koenker and Bassett 1978),
//   ρ_q(d) = 2 max(q d, (q - 1) d),  d = real - generated,  0 < q < 1;
// q = 0.5 gives |d|. What is best for q = 0.5 is the median, which at most voxels of a sparse
// volume is nothing; a higher q asks for an event wherever one has a chance above 1 - q.
//
// Volumes: [B, 2 bins, H, W], floating point, on one device. Result: a scalar [] that gradients
// flow through; a NaN passes through. Throw std::invalid_argument if shapes differ. Thread safe.

/// Mean over all voxels.
at::Tensor volume_loss(const at::Tensor& generated, const at::Tensor& real, double quantile);

/// Mean over pixels and polarities, of the volumes summed over time: how much happens at a pixel,
/// whenever it does.
at::Tensor count_loss(const at::Tensor& generated, const at::Tensor& real, double quantile);

}  // namespace eventgan
