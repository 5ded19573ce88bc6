#include "stages/generator/torch/calibrator.h"

#include <c10/core/InferenceMode.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "stages/generator/torch/fit_calibration.h"
#include "stages/generator/torch/network_forward_internal.h"

namespace eventgan {
namespace {

void check_frames(std::span<const float> frames, ImageSize size) {
  if (size.height < 1 || size.width < 1 || frames.size() != 2 * size.pixel_count()) {
    throw std::invalid_argument("expected frames [2, H, W] of " + std::to_string(size.width) + "x" +
                                std::to_string(size.height) + ", got " +
                                std::to_string(frames.size()) + " values");
  }
}

}  // namespace

Calibrator::Calibrator(const Weights& weights)
    : forward_(std::make_unique<const NetworkForward>(weights)),
      sums_(empty_calibration_sums(weights.base_channels)),
      base_channels_(weights.base_channels) {}

Calibrator::~Calibrator() = default;

void Calibrator::add(std::span<const float> frames, ImageSize size) {
  check_frames(frames, size);
  CalibrationSums pair = empty_calibration_sums(base_channels_);
  pair.pairs = 1;
  const auto add_observed = [&](const std::string& name, const at::Tensor& tensor) {
    const auto sums = std::ranges::find(pair.tensors, name, &TensorSums::name);
    if (sums == pair.tensors.end()) return;
    // Channels last, so this is most often the tensor's own memory.
    const at::Tensor pixels = tensor.permute({0, 2, 3, 1}).contiguous();
    add_tensor(*sums, {pixels.data_ptr<float>(), static_cast<std::size_t>(pixels.numel())});
  };
  const c10::InferenceMode inference;
  try {
    (*forward_)(frames, size, add_observed);
  } catch (const c10::Error&) {
    std::throw_with_nested(std::runtime_error("the calibration failed in LibTorch"));
  }
  merge(sums_, pair);
}

Calibration Calibrator::calibration(std::string origin) const {
  return fit_calibration(sums_, std::move(origin));
}

}  // namespace eventgan
