#include <torch/cuda.h>

#include "manifests/faults.h"
#include "stages/training/training_device_internal.h"

namespace eventgan {

c10::Device training_device(const std::string& name) {
  if (name == "cpu") return c10::kCPU;
  if (name != "cuda") {
    throw UsageError("expected the device \"cpu\" or \"cuda\", got \"" + name + "\"");
  }
  if (!torch::cuda::is_available()) {
    throw UsageError(
        "expected the device \"cpu\", got \"cuda\", which this LibTorch does not have (built "
        "without "
        "CUDA, or no device found)");
  }
  return c10::Device(c10::kCUDA, 0);
}

}  // namespace eventgan
