#include "stages/generator/torch/calibrator.h"

#include <ATen/Functions.h>
#include <ATen/TensorOperators.h>
#include <c10/core/InferenceMode.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "stages/generator/torch/detail/network_forward.h"

namespace eventgan {
namespace {

constexpr double kRidge = 0.1;
constexpr double kRidgeOfMean = 1e-3;

/// A mean variance below this part of the mean square is what rounding leaves of none.
constexpr double kNoVariance = 1e-9;

at::Tensor mean_of(const std::vector<double>& sums, double pixels, at::IntArrayRef shape) {
  return at::from_blob(const_cast<double*>(sums.data()), shape, at::kDouble) / pixels;
}

std::vector<float> values_of(const at::Tensor& tensor) {
  const at::Tensor values = tensor.to(at::kFloat).contiguous();
  return {values.data_ptr<float>(), values.data_ptr<float>() + values.numel()};
}

void fit_lost_part(const TensorSums& sums, TensorStatistics& statistics) {
  const auto channels = static_cast<std::int64_t>(sums.lost.size());
  const at::Tensor kept = mean_of(sums.kept, sums.pixels, {channels});
  const at::Tensor lost = mean_of(sums.lost, sums.pixels, {channels});
  const at::Tensor squares = mean_of(sums.kept_kept, sums.pixels, {channels, channels});
  const at::Tensor covariance = squares - at::outer(kept, kept);
  const at::Tensor cross =
      mean_of(sums.lost_kept, sums.pixels, {channels, channels}) - at::outer(lost, kept);

  const at::Tensor variance = covariance.diagonal().clamp_min(0);
  const double mean_variance = variance.mean().item<double>();
  at::Tensor mixing = at::zeros({channels, channels}, at::kDouble);
  if (mean_variance > kNoVariance * squares.diagonal().mean().item<double>()) {
    const at::Tensor ridge = at::diag(variance * kRidge + mean_variance * kRidgeOfMean);
    mixing = at::cholesky_solve(cross.t(), at::linalg_cholesky(covariance + ridge)).t();
  }
  statistics.offset = values_of(lost - at::mv(mixing, kept));
  statistics.mixing = values_of(mixing);
}

TensorStatistics fit(const TensorSums& sums) {
  TensorStatistics statistics;
  statistics.name = sums.name;
  statistics.highest.assign(sums.highest.begin(), sums.highest.end());
  std::ranges::transform(sums.kept, std::back_inserter(statistics.mean),
                         [&](double sum) { return static_cast<float>(sum / sums.pixels); });
  if (!sums.lost.empty()) fit_lost_part(sums, statistics);
  return statistics;
}

}  // namespace

Calibration fit_calibration(const CalibrationSums& sums, std::string origin) {
  if (sums.pairs < 1 || sums.tensors.empty()) {
    throw std::invalid_argument("expected sums of at least 1 pair, got none");
  }
  Calibration calibration{sums.pairs, std::move(origin), {}};
  const c10::InferenceMode inference;
  try {
    for (const TensorSums& tensor : sums.tensors) calibration.tensors.push_back(fit(tensor));
  } catch (const c10::Error&) {
    std::throw_with_nested(std::runtime_error("the calibration failed in LibTorch"));
  }
  const auto base_channels = static_cast<int>(sums.tensors.front().highest.size());
  check_calibration(calibration, base_channels, "the calibration's sums");
  return calibration;
}

namespace {

void check_frames(std::span<const float> frames, ImageSize size) {
  if (size.height < 1 || size.width < 1 || frames.size() != 2 * size.pixel_count()) {
    throw std::invalid_argument("expected frames [2, H, W] of " + to_string(size) + ", got " +
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
