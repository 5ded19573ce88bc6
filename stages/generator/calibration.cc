#include "stages/generator/calibration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "stages/generator/generator.h"

namespace eventgan {

std::vector<QuantizedTensor> quantized_tensors(int base_channels) {
  const auto encoder = [](int level) { return "encoders." + std::to_string(level); };
  const auto decoder = [](int level) { return "decoders." + std::to_string(level); };
  const int b = base_channels;
  const int widest = 16 * b;
  return {
      {"head", "head", b, true, "", {{encoder(0), 0}, {decoder(3), 2 * b}}},
      {encoder(0), encoder(0), 2 * b, true, "", {{encoder(1), 0}, {decoder(2), 4 * b}}},
      {encoder(1), encoder(1), 4 * b, true, "", {{encoder(2), 0}, {decoder(1), 8 * b}}},
      {encoder(2), encoder(2), 8 * b, true, "", {{encoder(3), 0}, {decoder(0), 16 * b}}},
      {encoder(3), encoder(3), widest, true, "", {{"resblocks.0.conv1", 0}}},
      {"resblocks.0.conv1", "resblocks.0.conv1", widest, false, "", {{"resblocks.0.conv2", 0}}},
      {"resblocks.0", "resblocks.0.conv2", widest, false, encoder(3), {{"resblocks.1.conv1", 0}}},
      {"resblocks.1.conv1", "resblocks.1.conv1", widest, false, "", {{"resblocks.1.conv2", 0}}},
      {"resblocks.1", "resblocks.1.conv2", widest, false, "resblocks.0", {{decoder(0), 0}}},
      {decoder(0), decoder(0), 8 * b, true, "", {{decoder(1), 0}}},
      {decoder(1), decoder(1), 4 * b, true, "", {{decoder(2), 0}}},
      {decoder(2), decoder(2), 2 * b, true, "", {{decoder(3), 0}}},
  };
}

namespace {

bool none_negative(const std::vector<float>& values) {
  return std::ranges::all_of(values, [](float value) { return value >= 0; });
}

void check_tensor(const TensorStatistics& got, const QuantizedTensor& tensor,
                  const std::string& name) {
  const auto fail = [&](const std::string& expected, const std::string& instead) {
    throw std::runtime_error("expected " + expected + " for " + tensor.name + ", got " + instead +
                             ", in " + name);
  };
  if (got.name != tensor.name) fail("statistics", "some for \"" + got.name + "\"");
  const std::size_t channels = tensor.channels;
  const std::size_t guessed = tensor.leaky ? channels : 0;
  for (const auto& [values, count] : {std::pair{&got.highest, channels},
                                      {&got.mean, channels},
                                      {&got.offset, guessed},
                                      {&got.mixing, guessed * guessed}}) {
    if (values->size() != count) {
      fail(std::to_string(count) + " values", std::to_string(values->size()));
    }
    if (!all_finite(*values)) fail("finite numbers", "NaN or infinity");
  }
  if (!none_negative(got.highest) || !none_negative(got.mean)) {
    fail("a highest value and a mean of at least 0", "a negative number");
  }
}

}  // namespace

void check_calibration(const Calibration& calibration, int base_channels, const std::string& name) {
  if (calibration.pairs < 1) {
    throw std::runtime_error("expected a calibration from at least 1 pair, got " +
                             std::to_string(calibration.pairs) + ", in " + name);
  }
  const std::vector<QuantizedTensor> tensors = quantized_tensors(base_channels);
  if (calibration.tensors.size() != tensors.size()) {
    throw std::runtime_error("expected " + std::to_string(tensors.size()) +
                             " calibrated tensors, got " +
                             std::to_string(calibration.tensors.size()) + ", in " + name);
  }
  for (std::size_t i = 0; i < tensors.size(); ++i) {
    check_tensor(calibration.tensors[i], tensors[i], name);
  }
}

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
