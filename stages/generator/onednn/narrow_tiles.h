#pragma once

#include <cstddef>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/onednn/activation_rows.h"
#include "stages/generator/onednn/layer_numbers.h"

namespace eventgan {

/// The last decoder of a network of base width 8 in bfloat16 by AMX's tiles: products of 16 pairs
/// of pixels that lie side by side, [pair, 32 values of theirs and their neighbours], with kernel
/// rows [32 values, 2 pixels x 8 channels]. A kernel row over 8 channels reads 24 values a pixel:
/// by pairs, all of a tile is used. Thread safe.
class NarrowTiles {
 public:
  /// `skip` and `phases` of the last decoder.
  NarrowTiles(const LayerNumbers& skip, const LayerNumbers& phases, ImageSize size);

  std::size_t buffer_bytes() const;

  /// Row y of the decoder, without bias and LeakyReLU: [x, channel] from pixel -1 on, and behind
  /// pixel 0 a whole number of 32 pixels; valid until the next row. What lies outside the image
  /// is undefined.
  /// Rows are computed in order, from row 0 on, on a processor with AMX (bfloat16); between them
  /// nothing else may write to `buffer`, of whole cache lines. small, skip, edges: as
  /// NarrowLayers::volume_row.
  const float* sum_row(const Bfloat16* small, const Bfloat16* skip, const DecoderRow& edges, int y,
                       std::byte* buffer) const;

 private:
  static constexpr int kChannels = 8;
  static constexpr int kTileRows = 16;

  std::ptrdiff_t sums_values() const { return (2 * kTileRows * blocks_ + 2) * kChannels; }
  // With the zeros on both sides, of whole cache lines.
  std::ptrdiff_t skip_row_values() const { return (2 * kTileRows * blocks_ + 4) * kChannels; }
  std::ptrdiff_t small_row_values() const { return (kTileRows * blocks_ + 2) * 2 * kChannels; }

  ImageSize size_;
  std::ptrdiff_t blocks_;  ///< of 16 pairs in a row
  // Tiles as AMX reads them.
  std::vector<Bfloat16> skip_;    ///< of each kernel row
  std::vector<Bfloat16> phases_;  ///< [row phase, kernel row]
};

}  // namespace eventgan
