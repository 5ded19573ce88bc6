#pragma once

#include <memory>
#include <string>

#include "manifests/values/job.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The reference engine: LibTorch on the CPU, on any processor, one intra-operation thread per
/// calling thread (set on the first call of each thread; the result's last bits depend on it). In
/// float32 it equals the published network within float tolerance for any image size. Throws as
/// check_weights; std::invalid_argument for kInt8, which LibTorch does not compute here;
/// std::runtime_error if LibTorch fails.
std::unique_ptr<Generator> make_torch_generator(const Weights& weights,
                                                Precision precision = Precision::kFloat32);

/// What LibTorch offers for a precision on CUDA.
struct CudaSupport {
  std::string lack;    ///< why it cannot be computed there; empty if it can
  std::string device;  ///< "cuda: NVIDIA H100 (compute capability 9.0)"; empty if there is none
};

/// Looks for the first CUDA device that CUDA_VISIBLE_DEVICES leaves. Where there is one, this
/// starts CUDA. Thread safe.
CudaSupport cuda_support(Precision precision);

/// The same engine with several pairs at a time, on the first CUDA device; on the CPU too, where it
/// gains nothing, to be tried without one. Pairs of one size that several threads have at the same
/// time are computed together, while these threads wait (Generator::device_calls); generate_tiles
/// computes all and clears what is not wanted.
///
/// Numbers on CUDA: float32 without TF32, cuDNN's deterministic kernels, no benchmark between them,
/// and always as many pairs in a batch of one size, zeros where there are fewer, so that neither
/// chance nor the number of pairs chooses a kernel. What is left to hope: that a kernel adds up
/// alike at each place of a batch, which neither LibTorch nor NVIDIA promises. Where one does not,
/// the last bits of a volume depend on its place. From the CPU's volumes they differ by rounding.
/// Subnormal numbers are computed as such there.
///
/// Throws as make_torch_generator; std::runtime_error if the device is not there or lacks memory.
std::unique_ptr<Generator> make_batched_generator(const Weights& weights, Precision precision,
                                                  Device device);

}  // namespace eventgan
