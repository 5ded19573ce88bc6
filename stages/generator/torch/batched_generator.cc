#include <ATen/Context.h>
#include <ATen/Functions.h>
#include <ATen/detail/CUDAHooksInterface.h>
#include <c10/core/InferenceMode.h>
#include <dlfcn.h>
#include <torch/cuda.h>
#include <torch/version.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stages/generator/flush_subnormals.h"
#include "stages/generator/pair_batches.h"
#include "stages/generator/torch/detail/network_forward.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

/// How many pairs of this size are computed at once: as many as have two million pixels together, 1
/// to 16. A pass holds about 2 x activation_bytes for each on the device: 1.5 GB for nine pairs of
/// 260x861 at base width 32 in float32.
int pairs_in_batch(ImageSize size) {
  constexpr std::size_t kPixels = std::size_t{1} << 21;
  constexpr std::size_t kMost = 16;
  return static_cast<int>(
      std::clamp<std::size_t>(kPixels / std::max<std::size_t>(size.pixel_count(), 1), 1, kMost));
}

/// Of the same job the same numbers, as far as that can be asked for: no kernels chosen by a race
/// between them, none that add up in an order left to chance, no float32 cut to 10 bits.
void ask_for_exact_kernels() {
  at::Context& context = at::globalContext();
  context.setBenchmarkCuDNN(false);
  context.setDeterministicCuDNN(true);
  context.setAllowTF32CuDNN(false);
  context.setAllowTF32CuBLAS(false);
}

class BatchedGenerator final : public Generator {
 public:
  BatchedGenerator(const Weights& weights, Precision precision, c10::Device device)
      : bins_(weights.bins),
        training_gaps_(weights.training_gaps),
        thresholds_(weights.thresholds),
        inputs_(weights.inputs()),
        precision_(precision),
        device_(device),
        forward_(weights, at::TensorOptions(device).dtype(
                              precision == Precision::kBfloat16 ? at::kBFloat16 : at::kFloat)),
        batches_(pairs_in_batch, [this](const PairBatches<at::Tensor>::Pairs& pairs,
                                        ImageSize size) { return compute(pairs, size); }) {}

  int bins() const override { return bins_; }
  std::optional<GapRange> training_gaps() const override { return training_gaps_; }
  std::optional<ThresholdRange> thresholds() const override { return thresholds_; }

  std::string description() const override {
    return "torch " + std::string(to_string(precision_)) + " on " + describe_device() +
           ", in batches, LibTorch " + TORCH_VERSION + ", " +
           describe_training_gaps(training_gaps_);
  }

  /// The pair's part of the memory that is copied from and to.
  std::size_t working_bytes(ImageSize size) const override {
    return (2 + 2 * static_cast<std::size_t>(bins_)) * size.pixel_count() * sizeof(float);
  }

  /// One batch at work, and the next one.
  int device_calls(ImageSize size) const override { return 2 * pairs_in_batch(size); }

  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    check_generator_spans(pair, volume, bins_);
    std::vector<float> kept;
    const std::span<const float> planes = network_planes(pair, thresholds_, kept);
    use_one_thread();
    const c10::InferenceMode inference;
    const FlushSubnormals flush;
    try {
      const at::Tensor computed = batches_.compute(planes, pair.size);
      at::from_blob(volume.data(), computed.sizes()).copy_(computed);
      return {};
    } catch (const c10::OutOfMemoryError&) {
      std::throw_with_nested(std::runtime_error(
          "expected memory on the device for " + std::to_string(pairs_in_batch(pair.size)) +
          " pairs of " + to_string(pair.size) +
          " at once, got less: set a smaller $.image.width and height, \"bfloat16\", or "
          "\"device\": \"cpu\""));
    } catch (const c10::Error&) {
      std::throw_with_nested(std::runtime_error("the generator failed in LibTorch"));
    }
  }

 private:
  /// "cuda: NVIDIA H100 (compute capability 9.0), CUDA Runtime 12.6, CuDNN 90.5.1".
  std::string describe_device() const {
    if (!device_.is_cuda()) return "cpu";
    std::string text = cuda_support(precision_).device;
    std::istringstream lines(at::detail::getCUDAHooks().showConfig());  // "  - CUDA Runtime 12.6\n"
    for (std::string line; std::getline(lines, line);) {
      const bool is_version = line.find("CUDA Runtime") != line.npos ||
                              line.find("CuDNN") != line.npos;  // the rest is how it was built
      if (is_version) text += ", " + line.substr(line.find_first_not_of(" -"));
    }
    return text;
  }

  /// Volumes [2 bins, H, W] of the precision's type, in memory that the device writes to directly.
  /// Every batch of a size has the same shape: where pairs lack, zeros stand for them, so that the
  /// number of pairs does not decide which kernels run.
  std::vector<at::Tensor> compute(const PairBatches<at::Tensor>::Pairs& pairs,
                                  ImageSize size) const {
    const auto count = static_cast<std::int64_t>(pairs.size());
    const at::TensorOptions pinned = at::TensorOptions(at::kFloat).pinned_memory(device_.is_cuda());
    const at::Tensor frames =
        at::empty({pairs_in_batch(size), inputs_, size.height, size.width}, pinned);
    for (std::int64_t i = 0; i < count; ++i) {
      std::ranges::copy(pairs[static_cast<std::size_t>(i)], frames[i].data_ptr<float>());
    }
    frames.slice(0, count).zero_();
    // In C order by the device; each thread converts its own volume.
    const at::Tensor computed = forward_(frames).slice(0, 0, count).contiguous();
    const at::Tensor volumes = at::empty(computed.sizes(), pinned.dtype(computed.scalar_type()));
    volumes.copy_(computed);  // waits for the device
    return volumes.unbind();
  }

  int bins_;
  std::optional<GapRange> training_gaps_;
  std::optional<ThresholdRange> thresholds_;
  int inputs_;
  Precision precision_;
  c10::Device device_;
  NetworkForward forward_;
  mutable PairBatches<at::Tensor> batches_;
};

/// What NVIDIA's driver says of the first device that CUDA_VISIBLE_DEVICES leaves. Asked by hand,
/// since LibTorch tells the name by CUDA's headers alone, which no build without CUDA has; the
/// driver's interface is in C and does not change.
struct DriverAnswer {
  std::string name = "unknown device";
  int major = 0;  ///< compute capability
  int minor = 0;
};

DriverAnswer ask_driver() {
  constexpr int kMajor = 75;  // CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR
  constexpr int kMinor = 76;
  DriverAnswer answer;
  void* const driver = dlopen("libcuda.so.1", RTLD_NOW | RTLD_LOCAL);  // LibTorch holds it already
  if (!driver) return answer;
  const auto init = reinterpret_cast<int (*)(unsigned)>(dlsym(driver, "cuInit"));
  const auto get_device = reinterpret_cast<int (*)(int*, int)>(dlsym(driver, "cuDeviceGet"));
  const auto get_name =
      reinterpret_cast<int (*)(char*, int, int)>(dlsym(driver, "cuDeviceGetName"));
  const auto get_number =
      reinterpret_cast<int (*)(int*, int, int)>(dlsym(driver, "cuDeviceGetAttribute"));
  int device = 0;
  std::array<char, 256> name{};
  if (init && get_device && get_name && get_number && init(0) == 0 && get_device(&device, 0) == 0 &&
      get_name(name.data(), static_cast<int>(name.size()) - 1, device) == 0 &&
      get_number(&answer.major, kMajor, device) == 0 &&
      get_number(&answer.minor, kMinor, device) == 0) {
    answer.name = name.data();
  }
  return answer;
}

}  // namespace

CudaSupport cuda_support(Precision precision) {
  CudaSupport support;
  if (!at::hasCUDA()) {
    support.lack = "LibTorch was built without CUDA";
  } else if (!torch::cuda::is_available()) {
    support.lack = "LibTorch finds no CUDA device";
  } else {
    const DriverAnswer answer = ask_driver();
    support.device = "cuda: " + answer.name + " (compute capability " +
                     std::to_string(answer.major) + "." + std::to_string(answer.minor) + ")";
    const bool is_known = answer.major > 0;
    if (precision == Precision::kBfloat16 && is_known && answer.major < 8) {
      support.lack = support.device + " has no bfloat16, which begins with 8.0";
    }
  }
  return support;
}

std::unique_ptr<Generator> make_batched_generator(const Weights& weights, Precision precision,
                                                  Device device) {
  if (precision == Precision::kInt8) {
    throw std::invalid_argument("expected float32 or bfloat16 for LibTorch, got int8");
  }
  if (device == Device::kCpu) {
    return std::make_unique<BatchedGenerator>(weights, precision, c10::kCPU);
  }
  const CudaSupport support = cuda_support(precision);
  if (!support.lack.empty()) {
    throw std::runtime_error("expected a CUDA device for " + std::string(to_string(precision)) +
                             ", got none: " + support.lack);
  }
  ask_for_exact_kernels();
  return std::make_unique<BatchedGenerator>(weights, precision, c10::Device(c10::kCUDA, 0));
}

}  // namespace eventgan
