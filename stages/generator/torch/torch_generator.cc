#include "stages/generator/torch/torch_generator.h"

#include <ATen/Functions.h>
#include <ATen/Version.h>
#include <c10/core/InferenceMode.h>
#include <torch/version.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "stages/generator/flush_subnormals.h"
#include "stages/generator/generator.h"
#include "stages/generator/torch/detail/network_forward.h"

namespace eventgan {
namespace {

class TorchGenerator final : public Generator {
 public:
  TorchGenerator(const Weights& weights, Precision precision)
      : bins_(weights.bins),
        base_channels_(weights.base_channels),
        training_gaps_(weights.training_gaps),
        thresholds_(weights.thresholds),
        precision_(precision),
        forward_(weights, precision == Precision::kBfloat16 ? at::kBFloat16 : at::kFloat) {}

  int bins() const override { return bins_; }
  std::optional<GapRange> training_gaps() const override { return training_gaps_; }
  std::optional<ThresholdRange> thresholds() const override { return thresholds_; }

  std::string description() const override {
    return "torch " + std::string(to_string(precision_)) + ", 1 thread, LibTorch " + TORCH_VERSION +
           ", " + at::get_mkldnn_version() + ", " + describe_training_gaps(training_gaps_);
  }

  /// LibTorch holds a layer's input, its output and all sub-pixel phases of a decoder at once,
  /// beside the skip connections: twice what the plan of buffers needs.
  std::size_t working_bytes(ImageSize size) const override {
    return 2 * activation_bytes(size, base_channels_, precision_ == Precision::kFloat32 ? 4 : 2);
  }

  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    check_generator_spans(pair, volume, bins_);
    std::vector<float> kept;
    const std::span<const float> planes = network_planes(pair, thresholds_, kept);
    const c10::InferenceMode inference;
    const FlushSubnormals flush;
    try {
      at::Tensor output =
          at::from_blob(volume.data(), {1, 2 * bins_, pair.size.height, pair.size.width});
      at::Tensor computed = forward_(planes, pair.size);
      // Channels are brought together in two bytes a value, and then converted: a third of the
      // time.
      if (precision_ == Precision::kBfloat16) computed = computed.contiguous();
      output.copy_(computed);
      return {};
    } catch (const c10::Error&) {
      std::throw_with_nested(std::runtime_error("the generator failed in LibTorch"));
    }
  }

 private:
  int bins_;
  int base_channels_;
  std::optional<GapRange> training_gaps_;
  std::optional<ThresholdRange> thresholds_;
  Precision precision_;
  NetworkForward forward_;
};

}  // namespace

std::unique_ptr<Generator> make_torch_generator(const Weights& weights, Precision precision) {
  if (precision == Precision::kInt8) {
    throw std::invalid_argument("expected float32 or bfloat16 for LibTorch, got int8");
  }
  return std::make_unique<TorchGenerator>(weights, precision);
}

}  // namespace eventgan
