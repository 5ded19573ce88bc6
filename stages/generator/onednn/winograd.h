#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "stages/generator/onednn/eight_lanes.h"
#include "stages/generator/onednn/layer_numbers.h"

namespace eventgan {

/// Whether a network of this base width computes all of its layers by the kernels of this file and
/// plane_layers.h: in float32, on a processor with AVX2 and FMA that has no AVX-512, as oneDNN sees
/// it, or computes its 512 bits in two halves (AMD's Zen 4, unless oneDNN is limited to less).
bool winograd_fits(int base_channels, Precision precision);
/// Counts up with what changes their bytes.
inline constexpr int kWinogradVersion = 1;

/// Below zero, in place of a ReLU's 0: with that oneDNN takes the larger of value and 0, which
/// turns NaN into 0; with another slope it multiplies. Small enough to vanish in every sum of
/// float32 or bfloat16, and far from subnormal.
inline constexpr float kNoSlope = 1e-30f;

/// activation(convolution(input) + bias [+ output]) of a 3x3 kernel with zeros around the image. Of
/// a decoder the kernel also sees the doubled small image. Float32; images are [y, x, channel]
/// without gaps, from a cache line on; channels are multiples of 8. By Winograd's minimal filtering
/// (Lavin and Gray, Fast Algorithms for Convolutional Neural Networks, 2016): a tile of 2x2 output
/// pixels has 16 products of channels where the kernel has 36; 9 of the doubled image, whose
/// neighbours are equal; 25 with stride 2. Sums differ from the kernel's in their last bits, and
/// infinity may come out as NaN. Thread safe.
class WinogradConvolution {
 public:
  /// stride: 1 or 2. A value below zero is multiplied with `slope`. `doubled`: the kernel over the
  /// doubled small image (`decoders.N.last_row`), with stride 1; or null.
  WinogradConvolution(const LayerNumbers& layer, int stride, float slope,
                      const LayerNumbers* doubled = nullptr);

  struct Images {
    const float* input = nullptr;
    const float* small = nullptr;  ///< of half_size(size); null where nothing is doubled
    ImageSize size;                ///< of the input
  };

  /// Rows of tiles. Each has output rows 2 row and 2 row + 1; with a small image those before them,
  /// 2 row - 1 and 2 row, which see the same of its rows.
  int tile_rows(ImageSize input) const;

  /// The tiles of rows first .. end - 1. `output`: row output_row of the result and those behind
  /// it. `add`: to what is there. `buffer`: buffer_bytes(), on a cache line.
  void run(const Images& images, int first, int end, float* output, int output_row, bool add,
           std::byte* buffer) const;

  /// The tiles that have these numbers, row by row. Each pixel of the result needs what its kernel
  /// sees, and no other pixel need be there.
  void run(const Images& images, std::span<const int> tiles, float* output, int output_row,
           bool add, std::byte* buffer) const;

  std::size_t buffer_bytes() const;

 private:
  struct Block;
  template <class TileAt>
  void run_blocks(const Images& images, int count, TileAt&& tile_at, float* output, int output_row,
                  bool add, std::byte* buffer) const;
  template <class Rule, class Other>
  void plan_sums(int other_channels);
  /// The layer's weights; those of a sum are behind `behind` other channels.
  template <class Rule>
  void pack(const LayerNumbers& layer, const std::array<int, 16>& behind);
  template <class Rule>
  void read_input(const Images& images, const Block& block) const;
  void read_small(const Images& images, const Block& block) const;
  template <int kTiles, int kVectors>
  void multiply_sums(const Block& block) const;
  template <class Rule>
  void write_output(const Images& images, const Block& block, float* output, int output_row,
                    bool add) const;
  ImageSize output_size(ImageSize input) const;
  int tiles_along(int side) const { return small_ > 0 ? side / 2 + 1 : (side + 1) / 2; }

  int in_, small_, out_, stride_;
  float slope_;
  int tiles_at_once_ = 0;
  int sums_ = 0;                        ///< of a tile, each of products of channels
  std::array<int, 17> depth_before_{};  ///< channels of the products of a sum and those before it
  std::array<int, 16> plain_depth_{};   ///< a sum's channels without the small image's
  std::vector<EightWeights> weights_;   ///< [sum, out / vector's, channel, out % vector's]
  std::vector<EightWeights> bias_;
};

}  // namespace eventgan
