#pragma once

#include <cstdint>

#include "stages/training/networks/patch_discriminator_internal.h"
#include "stages/training/networks/unet_internal.h"

namespace eventgan {

// Starting values, distributed as the published code draws them, but from CounterRandom keyed by
// the parameter's name: one seed gives one network, on every machine. Each sets all parameters and
// buffers.

/// Convolutions: Kaiming normal of slope 10, that is N(0, 2 / (101 fan_in)), bias 0. Batch norm:
/// scale 1, shift 0. Spectral-normalised convolutions: weight_bar uniform in ±1/√fan_in (LibTorch's
/// default; the published initialisation does not reach them), u and v random unit vectors.
void initialize(UNetImpl& network, std::uint64_t seed);

/// Weights and biases uniform in ±1/√fan_in (LibTorch's default, which the published code leaves).
void initialize(PatchDiscriminatorImpl& network, std::uint64_t seed);

}  // namespace eventgan
