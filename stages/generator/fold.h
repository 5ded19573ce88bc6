#pragma once

#include <string>

#include "stages/generator/state_dict.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The published generator's state dict (DESIGN section 4) as folded convolutions. Base width and
/// bins come from the shapes; a layer may be spectral-normalised (weight_bar, weight_u, weight_v)
/// or plain (weight).
///
/// Spectral norm: exactly one power iteration on loading, v = Wᵀu / (|Wᵀu| + 1e-12), u = W v / (|W
/// v| + 1e-12), σ = uᵀ W v, W ← W/σ, so that the output is the reference's first forward after
/// loading. Batch norm: W ← W γ/√(var + 1e-5), bias = β - mean γ/√(var + 1e-5). Sums in double
/// precision. Throws std::runtime_error naming the key that is missing or has another shape, or σ =
/// 0.
Weights fold_generator(const StateDict& state, const std::string& name);

}  // namespace eventgan
