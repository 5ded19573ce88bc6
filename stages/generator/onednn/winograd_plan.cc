#include "stages/generator/onednn/detail/winograd_plan.h"

#include <algorithm>
#include <span>
#include <string>

namespace eventgan {

WinogradPlan::WinogradPlan(const WinogradLayers& layers, int base_channels, ImageSize size,
                           BufferLayout& layout)
    : layers_(layers), base_channels_(static_cast<std::size_t>(base_channels)) {
  const auto add = [&](ImageSize of, std::size_t channels) {
    const std::size_t values = of.pixel_count() * channels;
    return Buffer{layout.add(values * sizeof(float)), values};
  };
  for (std::size_t level = 0; level < skips_.size(); ++level) {
    sizes_[level] = level == 0 ? size : half_size(sizes_[level - 1]);
    skips_[level] = add(sizes_[level], base_channels_ << level);
  }
  between_ = add(sizes_.back(), base_channels_ << kNetworkLevels);
  for (std::size_t level = 0; level < decoded_.size(); ++level) {
    const std::size_t skip = kNetworkLevels - 1 - level;
    decoded_[level] = add(sizes_[skip], base_channels_ << skip);
  }
  // The two rows of a row of tiles, and what is read behind them.
  const std::size_t pixels = 2 * static_cast<std::size_t>(size.width) + PlanePrediction::kPixels;
  decoded_rows_ = layout.add(sizeof(float) * pixels * base_channels_);

  std::size_t bytes = std::max(layers.head.buffer_bytes(size), layers.prediction.buffer_bytes());
  for (const auto* list : {&layers.encoders, &layers.residuals, &layers.decoders}) {
    for (const WinogradConvolution& layer : *list) bytes = std::max(bytes, layer.buffer_bytes());
  }
  kernels_ = layout.add(bytes);
}

GenerationNotes WinogradPlan::run(const float* planes, float* volume, std::byte* block,
                                  const TensorObserver& observe, const WinogradWork* work,
                                  const TileMask* wanted) const {
  const auto at = [&](const Buffer& buffer) {
    return reinterpret_cast<float*>(block + buffer.offset);
  };
  const auto compute = [&](const WinogradConvolution& layer,
                           const WinogradConvolution::Images& images, const Buffer& target,
                           const std::vector<int>* tiles, bool add, const std::string& name) {
    if (tiles) {
      layer.run(images, *tiles, at(target), 0, add, block + kernels_);
    } else {
      layer.run(images, 0, layer.tile_rows(images.size), at(target), 0, add, block + kernels_);
    }
    if (observe) observe(name, {at(target), target.values});
  };
  layers_.head.run(planes, sizes_[0], at(skips_[0]), block + kernels_);
  if (observe) observe("head", {at(skips_[0]), skips_[0].values});
  for (std::size_t level = 0; level < kNetworkLevels; ++level) {
    compute(layers_.encoders[level], {at(skips_[level]), nullptr, sizes_[level]}, skips_[level + 1],
            work ? &work->encoders[level] : nullptr, false, "encoders." + std::to_string(level));
  }
  const Buffer& bottleneck = skips_.back();
  for (std::size_t i = 0; i < 2 * kResidualBlocks; ++i) {
    const bool second = i % 2 == 1;
    compute(layers_.residuals[i], {at(second ? between_ : bottleneck), nullptr, sizes_.back()},
            second ? bottleneck : between_, work ? &work->residuals[i] : nullptr, second,
            "resblocks." + std::to_string(i / 2) + (second ? "" : ".conv1"));
  }
  const float* small = at(bottleneck);
  for (std::size_t level = 0; level < decoded_.size(); ++level) {
    const std::size_t skip = kNetworkLevels - 1 - level;
    compute(layers_.decoders[level], {at(skips_[skip]), small, sizes_[skip]}, decoded_[level],
            work ? &work->decoders[level] : nullptr, false, "decoders." + std::to_string(level));
    small = at(decoded_[level]);
  }
  const bool sound = run_end({at(skips_[0]), small, sizes_[0]}, volume, block,
                             work ? &work->decoders.back() : nullptr, wanted);
  return {.saturated_share = 0, .sound = sound};
}

bool WinogradPlan::run_end(const WinogradConvolution::Images& images, float* volume,
                           std::byte* block, const std::vector<int>* tiles,
                           const TileMask* wanted) const {
  const WinogradConvolution& layer = layers_.decoders.back();
  auto* decoded = reinterpret_cast<float*>(block + decoded_rows_);
  std::byte* kernels = block + kernels_;
  const ImageSize size = images.size;
  const int columns = size.width / 2 + 1;
  bool sound = true;
  auto some = tiles ? tiles->begin() : std::vector<int>::const_iterator();
  for (int row = 0; row < layer.tile_rows(size); ++row) {
    const int first = 2 * row - 1;
    const auto predict = [&](const TileMask::Pixels& pixels) {
      for (int y = pixels.top; y < pixels.bottom; ++y) {
        const std::ptrdiff_t pixel =
            static_cast<std::ptrdiff_t>(y - first) * size.width + pixels.left;
        sound &=
            layers_.prediction.run(decoded + pixel * static_cast<std::ptrdiff_t>(base_channels_),
                                   size, y, pixels.left, pixels.right, volume, kernels);
      }
    };
    const TileMask::Pixels rows{std::max(first, 0), std::min(first + 2, size.height), 0,
                                size.width};
    if (!tiles) {
      layer.run(images, row, row + 1, decoded, first, false, kernels);
      predict(rows);
      continue;
    }
    const auto end = std::lower_bound(some, tiles->end(), (row + 1) * columns);
    layer.run(images, std::span(some, end), decoded, first, false, kernels);
    wanted->visit_within(rows, predict);
    some = end;
  }
  return sound;
}

}  // namespace eventgan
