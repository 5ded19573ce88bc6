#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

namespace eventgan {

/// Result of the flow loss, summed over all scales: scalars that gradients flow through.
struct FlowLoss {
  at::Tensor photometric;
  at::Tensor smoothness;  ///< not yet weighted
  at::Tensor warped;      ///< [B, 1, H, W]: previous frame, moved to the next by the finest flow
};

/// Multi-scale photometric and smoothness loss of a flow between two frames, with the numbers of
/// the published code (EventGAN, section 3.3; equations in losses.cc).
///
/// `previous`, `next`: [B, 1, H, W] grey, in [-1, 1]. `flows`: coarse to fine, at least one, each
/// [B, 2, h, w]; channel 0 is the shift in x as a fraction of the width, 1 in y as a fraction of
/// the height; pixel (x, y) of `next` is looked up in `previous` at (x + u, y + v). `mask`: [B, 1,
/// H, W] or [B, H, W], any type, ≥ 0: how much a pixel's photometric error counts, a first side of
/// 1 standing for every sample. All floating-point tensors of one type, float32 or float64, on one
/// device and outside autocast.
///
/// A sample whose mask is all zero adds 0 to the photometric loss. A NaN passes through. Throws
/// std::invalid_argument if shapes do not fit. Thread safe.
FlowLoss multi_scale_flow_loss(const at::Tensor& previous, const at::Tensor& next,
                               const std::vector<at::Tensor>& flows, const at::Tensor& mask);

// How alike two images are, with the numbers of the published code. Images: [B, 1, H, W], both
// of one type, float32 or float64, in [-1, 1], on one device and outside autocast (bfloat16 has too
// few bits for a variance). Results: scalars [] that gradients flow through; a NaN passes through.
// Throw std::invalid_argument if shapes differ. Thread safe.

/// Structural similarity (Wang et al. 2004), mean over all pixels: 11x11 Gaussian window, σ = 1.5,
/// zeros beyond the edge, constants for images in 0..1. At most 1, which equal images have.
at::Tensor ssim(const at::Tensor& first, const at::Tensor& second);

/// mean|image - target| - SSIM(image, target); at least -1.
at::Tensor image_loss(const at::Tensor& image, const at::Tensor& target);

/// Σ_i 2^(i - n + 1) image_loss(images[i], target), i = 0 the coarsest of n ≥ 1 scales.
///
/// `images`: [B, 1, h, w] each, coarse to fine, brought to the target's size by nearest neighbour;
/// `target`: [B, 1, H, W]; else as image_loss says. Throws std::invalid_argument if shapes
/// do not fit. Thread safe.
at::Tensor multi_scale_reconstruction_loss(const std::vector<at::Tensor>& images,
                                           const at::Tensor& target);

// Hinge losses of a GAN (Lim and Ye 2017; Miyato et al. 2018), as the published code has them.
// Logits: [B, 1, h, w] floating point, any size that is not empty, on one device. Results: scalars
// [] that gradients flow through; a NaN passes through. Thread safe.

/// Discriminator: mean(max(0, 1 - real)) + mean(max(0, 1 + fake)), ≥ 0; 2 for logits all 0.
at::Tensor discriminator_hinge_loss(const at::Tensor& real_logits, const at::Tensor& fake_logits);

/// Generator: -mean(logits), `logits` being the discriminator's for generated volumes.
at::Tensor generator_hinge_loss(const at::Tensor& logits);

// A direct pull towards the real volume, not in the paper: for trainings too short for the others.
// The first two are means of the quantile loss (Koenker and Bassett 1978),
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

/// Where there are events, however many: 1 - F1 made smooth (Dice loss: Milletari et al. 2016),
/// over the whole batch, once of the voxels and once of the volumes summed over time, added:
///   1 - (2 Σ p t + 1) / (Σ p + Σ t + 1),  t = 1 where the real one has any, else 0,
///   p = min(1, v / 0.25), v the generated one, what is below zero left out: a quarter of an event
/// is one. In 0..2; 0 where both are empty. What the quantile losses let stand, a little everywhere
/// that something might happen, it does not. A NaN of the real volume does not pass.
at::Tensor overlap_loss(const at::Tensor& generated, const at::Tensor& real);

/// How unlikely the real volume is where the generated one is the number of events to be expected
/// in each voxel: half the deviance of a Poisson process, the mean over all voxels of
///   r - n - n ln(r / n),  r = λ + δ,  n = real + δ,  δ = 1
/// λ the generated one, ≥ 0. It is ≥ 0, and 0 where just what was expected happened. The background
/// δ, in both, leaves the best λ what it is without: the mean of what happens. The gradient,
/// (λ - real) / (λ + δ), then lies between -real and 1; with a small δ a single event where hardly
/// any are expected outweighs all others. Else as volume_loss says.
at::Tensor likelihood_loss(const at::Tensor& generated, const at::Tensor& real);

/// likelihood_loss of the sums over blocks of 8x8 pixels, bin by bin; those at the right and lower
/// border may be smaller. How many events an edge makes is surer than in which pixels it makes
/// them: this keeps the number right where the direct losses leave unlikely voxels empty.
at::Tensor block_likelihood_loss(const at::Tensor& generated, const at::Tensor& real);

}  // namespace eventgan
