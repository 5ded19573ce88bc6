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
/// the published code (EventGAN, section 3.3; equations in flow_loss.cc).
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

}  // namespace eventgan
