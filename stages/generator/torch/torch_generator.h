#pragma once

#include <memory>

#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The reference engine: LibTorch on the CPU in float32, one intra-operation thread per calling
/// thread (set on the first call of each thread; the result's last bits depend on it). Equals the
/// published network within float tolerance for any picture size. Throws as check_weights.
std::unique_ptr<Generator> make_torch_generator(const Weights& weights);

}  // namespace eventgan
