#include "stages/generator/calibration/calibration_sums.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "stages/generator/calibration/quantized_tensors.h"

namespace eventgan {
namespace {

void add(std::vector<double>& values, const std::vector<double>& more) {
  std::ranges::transform(values, more, values.begin(), std::plus<>());
}

/// Neighbours say much the same, and the pairs of channels cost channels² a pixel.
constexpr std::size_t kMostPixels = 4096;

void add_scaled(std::span<double> sums, double factor, std::span<const double> values) {
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += factor * values[i];
}

void add_pixel(TensorSums& sums, std::span<const float> pixel, std::vector<double>& kept) {
  const std::size_t channels = pixel.size();
  std::ranges::transform(pixel, kept.begin(), [](float x) { return std::max(double(x), 0.0); });
  add_scaled(sums.kept, 1, kept);
  ++sums.pixels;
  if (sums.lost.empty()) return;
  for (std::size_t c = 0; c < channels; ++c) {
    sums.lost[c] += std::min(double(pixel[c]), 0.0);
    auto& pairs = pixel[c] > 0 ? sums.kept_kept : sums.lost_kept;
    add_scaled(std::span(pairs).subspan(c * channels, channels), pixel[c], kept);
  }
}

bool same_sizes(const TensorSums& a, const TensorSums& b) {
  return a.name == b.name && a.highest.size() == b.highest.size() &&
         a.kept.size() == b.kept.size() && a.lost.size() == b.lost.size() &&
         a.kept_kept.size() == b.kept_kept.size() && a.lost_kept.size() == b.lost_kept.size();
}

}  // namespace

CalibrationSums empty_calibration_sums(int base_channels) {
  CalibrationSums sums;
  for (const QuantizedTensor& tensor : quantized_tensors(base_channels)) {
    const std::size_t channels = tensor.channels;
    const std::size_t guessed = tensor.leaky ? channels : 0;
    TensorSums& empty = sums.tensors.emplace_back();
    empty.name = tensor.name;
    empty.highest.resize(channels);
    empty.kept.resize(channels);
    empty.lost.resize(guessed);
    empty.kept_kept.resize(guessed * guessed);
    empty.lost_kept.resize(guessed * guessed);
  }
  return sums;
}

void add_tensor(TensorSums& sums, std::span<const float> values) {
  const std::size_t channels = sums.highest.size();
  if (values.empty() || values.size() % channels != 0) {
    throw std::invalid_argument("expected " + std::to_string(channels) + " channels of " +
                                sums.name + ", got " + std::to_string(values.size()) + " values");
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      throw std::runtime_error("expected finite values of " + sums.name + ", got NaN or infinity");
    }
    double& highest = sums.highest[i % channels];
    highest = std::max(highest, double(values[i]));
  }
  const std::size_t pixels = values.size() / channels;
  const std::size_t taken = std::min(pixels, kMostPixels);
  std::vector<double> kept(channels);
  for (std::size_t i = 0; i < taken; ++i) {
    add_pixel(sums, values.subspan(i * pixels / taken * channels, channels), kept);
  }
}

void merge(CalibrationSums& sums, const CalibrationSums& more) {
  if (!std::ranges::equal(sums.tensors, more.tensors, same_sizes)) {
    throw std::invalid_argument("expected sums of one base width, got those of two");
  }
  sums.pairs += more.pairs;
  for (std::size_t i = 0; i < sums.tensors.size(); ++i) {
    TensorSums& into = sums.tensors[i];
    const TensorSums& from = more.tensors[i];
    into.pixels += from.pixels;
    std::ranges::transform(into.highest, from.highest, into.highest.begin(),
                           [](double a, double b) { return std::max(a, b); });
    add(into.kept, from.kept);
    add(into.lost, from.lost);
    add(into.kept_kept, from.kept_kept);
    add(into.lost_kept, from.lost_kept);
  }
}

}  // namespace eventgan
