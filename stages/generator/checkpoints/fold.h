#pragma once

#include <optional>
#include <string>

#include "manifests/values/weights.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The published generator's state dict as folded convolutions. Base width and
/// bins come from the shapes; a network with `thresholds` has three inputs, others two. Each
/// layer's convolution may be
///   spectral-normalised, NAME.conv2d.module.{weight_bar, weight_u, weight_v},
///   plain, NAME.conv2d.weight, or
///   NAME.weight as network_layout names it,
/// where residual blocks have no ".conv2d" (resblocks.0.conv1.weight). It may have a bias, batch
/// norm (NAME.norm_layer.*; of resblocks.0.conv1: resblocks.0.bn1.*), or both. A layer with a bias
/// and without batch norm is taken as folded already; one with neither is refused.
///
/// Spectral norm: exactly one power iteration on loading, v = Wᵀu / (|Wᵀu| + 1e-12), u = W v / (|W
/// v| + 1e-12), σ = uᵀ W v, W ← W/σ, so that the output is the reference's first forward after
/// loading. Batch norm: W ← W γ/√(var + 1e-5), bias = β + (own bias - mean) γ/√(var + 1e-5). Sums
/// in double precision. A tensor is freed when its layer is done. Throws std::runtime_error naming
/// the key that is missing, has another shape or belongs to no layer (a network with more blocks
/// computes something else), or σ = 0.
Weights fold_generator(StateDict state, const std::string& name,
                       const std::optional<ThresholdRange>& thresholds = std::nullopt);

}  // namespace eventgan
