#include "stages/training/detail/training_networks.h"

#include <ATen/autocast_mode.h>
#include <c10/core/Device.h>
#include <torch/cuda.h>
#include <torch/version.h>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "stages/training/networks/detail/network_state.h"

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

namespace {

// Autocast of this thread: LibTorch 2.4 has one function for all devices in place of one for each.
#if TORCH_VERSION_MAJOR > 2 || (TORCH_VERSION_MAJOR == 2 && TORCH_VERSION_MINOR >= 4)

bool autocast_enabled(c10::DeviceType device) { return at::autocast::is_autocast_enabled(device); }

void set_autocast_enabled(c10::DeviceType device, bool enabled) {
  at::autocast::set_autocast_enabled(device, enabled);
}

void set_autocast_dtype(c10::DeviceType device, at::ScalarType dtype) {
  at::autocast::set_autocast_dtype(device, dtype);
}

#else

bool autocast_enabled(c10::DeviceType device) {
  return device == c10::kCUDA ? at::autocast::is_enabled() : at::autocast::is_cpu_enabled();
}

void set_autocast_enabled(c10::DeviceType device, bool enabled) {
  device == c10::kCUDA ? at::autocast::set_enabled(enabled)
                       : at::autocast::set_cpu_enabled(enabled);
}

void set_autocast_dtype(c10::DeviceType device, at::ScalarType dtype) {
  device == c10::kCUDA ? at::autocast::set_autocast_gpu_dtype(dtype)
                       : at::autocast::set_autocast_cpu_dtype(dtype);
}

#endif

/// While it lives, this thread's convolutions on the device run in bfloat16 (LibTorch's autocast),
/// if `enabled`. Parameters stay float32; their casts are forgotten at the end. For forward passes
/// alone: losses and backward passes stay outside.
class AutocastScope {
 public:
  AutocastScope(c10::Device device, bool enabled);
  ~AutocastScope();
  AutocastScope(const AutocastScope&) = delete;
  AutocastScope& operator=(const AutocastScope&) = delete;

 private:
  c10::DeviceType device_;
  bool enabled_;
  bool enabled_before_ = false;
};

}  // namespace

AutocastScope::AutocastScope(c10::Device device, bool enabled)
    : device_(device.type()), enabled_(enabled) {
  if (!enabled_) return;
  enabled_before_ = autocast_enabled(device_);
  set_autocast_dtype(device_, at::kBFloat16);
  at::autocast::increment_nesting();
  set_autocast_enabled(device_, true);
}

AutocastScope::~AutocastScope() {
  if (!enabled_) return;
  // The cache holds casts of parameters, which the next optimiser step makes stale.
  if (at::autocast::decrement_nesting() == 0) at::autocast::clear_cache();
  set_autocast_enabled(device_, enabled_before_);
}

namespace {

UNetSettings cycle_network(const NetworkSpec& spec, int in_channels, int out_channels) {
  return {in_channels, out_channels, spec.cycle_channels, true, SpectralNormPlace::kNone};
}

}  // namespace

TrainingNetworks::TrainingNetworks(const TrainingManifest& manifest, c10::Device target)
    : device(target),
      bfloat16(manifest.precision == TrainingPrecision::kBfloat16),
      difference_gain(manifest.network.difference_gain) {
  const NetworkSpec& spec = manifest.network;
  const int channels = 2 * spec.bins;
  generator = UNet(UNetSettings{spec.sensor ? 3 : 2, channels, spec.generator_channels, false,
                                spec.spectral_norm, spec.difference_gain});
  flow = UNet(cycle_network(spec, channels, 2));
  reconstruction = UNet(cycle_network(spec, 2, 1));
  discriminator = PatchDiscriminator(channels, 2, spec.discriminator_channels);

  const auto seed = [&](const char* network) {
    return CounterRandom(manifest.seed).keyed(network).bits(0);
  };
  initialize(*generator, seed("generator"));
  initialize(*flow, seed("flow"));
  initialize(*reconstruction, seed("reconstruction"));
  initialize(*discriminator, seed("discriminator"));
  generator->to(device);
  flow->to(device);
  reconstruction->to(device);
  discriminator->to(device);
}

std::vector<at::Tensor> TrainingNetworks::run(UNet& network, const at::Tensor& input) const {
  std::vector<at::Tensor> outputs;
  {
    const AutocastScope lower(device, bfloat16);
    outputs = network->forward(input);
  }
  for (at::Tensor& output : outputs) output = output.to(at::kFloat);
  return outputs;
}

at::Tensor TrainingNetworks::discriminate(const at::Tensor& volume, const at::Tensor& images) {
  const AutocastScope lower(device, bfloat16);
  return discriminator->forward(volume, images).to(at::kFloat);
}

StateDict TrainingNetworks::generator_of_frames() const {
  StateDict state;
  save_network(*generator, state, "");
  if (difference_gain == 0) return state;
  // m (p + n) / 2 + d g (n - p) = (m / 2 - g d) p + (m / 2 + g d) n; of weights [b, 2, 3, 3], or
  // [b, 3, 3, 3] with g c for the change c
  NamedTensor& head = state.at("head.conv2d.weight");
  const std::size_t kernel = std::size_t(head.shape[2] * head.shape[3]);
  const std::size_t inputs = std::size_t(head.shape[1]);
  for (std::size_t first = 0; first < head.values.size(); first += inputs * kernel) {
    for (std::size_t i = first; i < first + kernel; ++i) {
      const double mean = head.values[i], difference = difference_gain * head.values[i + kernel];
      head.values[i] = static_cast<float>(mean / 2 - difference);
      head.values[i + kernel] = static_cast<float>(mean / 2 + difference);
      if (inputs == 3) head.values[i + 2 * kernel] *= static_cast<float>(difference_gain);
    }
  }
  return state;
}

}  // namespace eventgan
