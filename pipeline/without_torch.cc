// In place of LibTorch's rooms in `eventgan`, which starts at once because it does not load
// LibTorch: what needs it is done by `eventgan-torch`, the same program with these rooms.

#include "pipeline/runtime/errors.h"
#include "pipeline/training/run_training.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

[[noreturn]] void hand_over() {
  throw HandOver{
      "eventgan-torch",
      "install the Debian package eventgan-torch, take the image with LibTorch, or build "
      "it (docker/bootstrap.sh package, docker build --target torch, "
      "docker/bootstrap.sh build)"};
}

}  // namespace

std::unique_ptr<Generator> make_torch_generator(const Weights&, Precision) { hand_over(); }

std::unique_ptr<Generator> make_batched_generator(const Weights&, Precision, Device) {
  hand_over();
}

CudaSupport cuda_support(Precision) { hand_over(); }

TrainingReport run_training(const TrainingManifest&, const TrainingOptions&) { hand_over(); }

}  // namespace eventgan
