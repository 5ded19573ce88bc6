// In place of LibTorch's rooms in `eventgan`, which starts at once because it does not load
// LibTorch: what needs it is done by `eventgan-torch`, the same program with these rooms.

#include "pipeline/runtime/errors.h"
#include "pipeline/training/run_training.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {

std::unique_ptr<Generator> make_torch_generator(const Weights&, Precision) { throw NeedsTorch(); }

std::unique_ptr<Generator> make_batched_generator(const Weights&, Precision, Device) {
  throw NeedsTorch();
}

CudaSupport cuda_support(Precision) { throw NeedsTorch(); }

TrainingReport run_training(const TrainingManifest&, const TrainingOptions&) { throw NeedsTorch(); }

}  // namespace eventgan
