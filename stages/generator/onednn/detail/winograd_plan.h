#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/tiles.h"
#include "stages/generator/generator.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/detail/network_layers.h"
#include "stages/generator/onednn/detail/tiled_layers.h"

namespace eventgan {

/// What NetworkPlan is, for layers that winograd.h computes. Thread safe.
class WinogradPlan {
 public:
  /// `layers` must outlive it. Adds its buffers to `layout`; `block` is what its offsets count
  /// from.
  WinogradPlan(const WinogradLayers& layers, int base_channels, ImageSize size,
               BufferLayout& layout);

  /// As NetworkPlan::run.
  GenerationNotes run(const float* planes, float* volume, std::byte* block,
                      const TensorObserver& observe) const {
    return run(planes, volume, block, observe, nullptr, nullptr);
  }

  /// The same for the tiles that are wanted, by what winograd_work says of them, bit for bit;
  /// nothing else of the volume is written.
  GenerationNotes run_tiles(const WinogradWork& work, const TileMask& wanted, const float* planes,
                            float* volume, std::byte* block) const {
    return run(planes, volume, block, {}, &work, &wanted);
  }

 private:
  struct Buffer {
    std::size_t offset = 0;
    std::size_t values = 0;
  };

  /// work, wanted: null for the whole image.
  GenerationNotes run(const float* planes, float* volume, std::byte* block,
                      const TensorObserver& observe, const WinogradWork* work,
                      const TileMask* wanted) const;
  /// The last decoder and the prediction, so that the last activations need two rows. Whether what
  /// was predicted is finite.
  bool run_end(const WinogradConvolution::Images& images, float* volume, std::byte* block,
               const std::vector<int>* tiles, const TileMask* wanted) const;

  const WinogradLayers& layers_;
  std::size_t base_channels_;
  std::array<ImageSize, kNetworkLevels + 1> sizes_;  ///< of skips_
  /// What each encoder reads, and the decoder beside it; then the last encoder's output, the
  /// residual blocks' too.
  std::array<Buffer, kNetworkLevels + 1> skips_;
  Buffer between_;  ///< within a residual block
  std::array<Buffer, kNetworkLevels - 1> decoded_;
  std::size_t decoded_rows_ = 0;  ///< the last decoder's, of a row of tiles
  std::size_t kernels_ = 0;       ///< for winograd.h's kernels
};

}  // namespace eventgan
