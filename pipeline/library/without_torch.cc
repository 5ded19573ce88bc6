// In place of LibTorch's engine in the library, which must live beside any PyTorch.

#include "manifests/values/faults.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

[[noreturn]] void refuse() {
  throw UsageError(
      "expected a processor on which oneDNN computes this precision, got one that LibTorch "
      "would be needed for: use the program eventgan");
}

}  // namespace

std::unique_ptr<Generator> make_torch_generator(const Weights&, Precision) { refuse(); }

std::unique_ptr<Generator> make_batched_generator(const Weights&, Precision, Device) { refuse(); }

CudaSupport cuda_support(Precision) { refuse(); }

}  // namespace eventgan
