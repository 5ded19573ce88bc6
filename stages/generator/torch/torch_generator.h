#pragma once

#include <memory>

#include "manifests/values/job.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The reference engine: LibTorch on the CPU, on any processor, one intra-operation thread per
/// calling thread (set on the first call of each thread; the result's last bits depend on it). In
/// float32 it equals the published network within float tolerance for any picture size. Throws as
/// check_weights; std::invalid_argument for kInt8, which LibTorch does not compute here;
/// std::runtime_error if LibTorch fails.
std::unique_ptr<Generator> make_torch_generator(const Weights& weights,
                                                Precision precision = Precision::kFloat32);

}  // namespace eventgan
