#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <dnnl.hpp>
#include <list>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/tiles.h"
#include "stages/generator/onednn/activation_rows.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/detail/fused_convolution.h"
#include "stages/generator/onednn/detail/network_layers.h"
#include "stages/generator/weights.h"

namespace eventgan {

// Layers that compute some of their output alone. A tile has one shape for images of all sizes:
// its input is brought together with its surroundings, zeros beyond the image. Each adds its
// buffers to a layout, and `block` is what that layout's offsets count from. Thread safe.

/// A tile's first pixel: of an encoder in its output, of a decoder in its sub-pixel phases.
struct TilePlace {
  int row = 0;
  int column = 0;
};

/// An image of activations: [y, x, channel] without gaps.
struct Activations {
  std::byte* data = nullptr;
  ImageSize size;
  std::size_t pixel_bytes = 0;
};

/// An encoder's tiles.
class EncoderTile {
 public:
  /// Throws dnnl::error.
  EncoderTile(NetworkLayers& layers, int level, ImageSize size, BufferLayout& layout);

  /// Not null: `counted` counts what is stored in 8 bits; as below.
  void run(dnnl::stream& stream, std::byte* block, TilePlace place, const Activations& source,
           const Activations& target, SaturationCount* counted) const;

 private:
  ImageSize size_;
  FusedConvolution convolution_;
  std::size_t input_, output_, scratch_;
};

/// A convolution at single pixels: of small images with many channels, where tiles would compute
/// much that nobody needs. What some pixels see is laid side by side, and what was a kernel is one
/// of 1x1.
class PixelConvolution {
 public:
  /// `setup`: but for its input, of which `count` pixels are computed at a time. Throws
  /// dnnl::error.
  PixelConvolution(NetworkLayers& layers, const std::string& name, ConvolutionSetup setup,
                   int count, BufferLayout& layout);

  /// Pixel i of the next output: it sees the source from (stride y - 1, stride x - 1) on.
  void gather(std::byte* block, int i, int y, int x, const Activations& source) const;
  void compute(dnnl::stream& stream, std::byte* block) const {
    convolution_.run(stream, block + input_, block + output_, block + scratch_);
  }
  /// Where that pixel is put.
  std::byte* output(std::byte* block, int i) const { return block + output_ + i * output_bytes_; }

  /// All of it for the pixels of `target` that have these numbers, some at a time; what stands
  /// there is added, if the setup says so.
  void run(dnnl::stream& stream, std::byte* block, const std::vector<int>& pixels,
           const Activations& source, const Activations& target, SaturationCount* counted) const;

 private:
  LayerWeights weights_;
  int side_, stride_, count_;
  bool adds_;
  FusedConvolution convolution_;
  std::size_t output_bytes_;  ///< of a pixel
  std::size_t input_, output_, scratch_;
};

/// A decoder at single pixels of its phases, each with the up to four pixels of its output.
class DecoderPixels {
 public:
  DecoderPixels(NetworkLayers& layers, int level, BufferLayout& layout);

  /// `pixels`: numbers of the phases' pixels, `large` the output's size. Calls visit(y, x, row) for
  /// each output pixel, row by row of each; `row` as DecoderTile::row gives it.
  template <class Visit>
  void run(dnnl::stream& stream, std::byte* block, const std::vector<int>& pixels,
           const Activations& small, const Activations& skip, Visit&& visit) const {
    const int columns = skip.size.width / 2 + 1;
    for (std::size_t first = 0; first < pixels.size(); first += kAtOnce) {
      const std::span some(pixels.data() + first, std::min(kAtOnce, pixels.size() - first));
      compute(stream, block, some, columns, small, skip);
      for (int i = 0; i < 4 * static_cast<int>(some.size()); ++i) {
        const int pixel = some[static_cast<std::size_t>(i / 4)];
        const int y = 2 * (pixel / columns) - 1 + i % 4 / 2;
        const int x = 2 * (pixel % columns) - 1 + i % 2;
        if (y < 0 || x < 0 || y >= skip.size.height || x >= skip.size.width) continue;
        visit(y, x,
              DecoderRow{1, channels_, y % 2, x % 2, sums(skip_sums_, block, i),
                         sums(phase_sums_, block, i / 4), nullptr, nullptr});
      }
    }
  }

 private:
  static constexpr std::size_t kAtOnce = 32;

  void compute(dnnl::stream& stream, std::byte* block, std::span<const int> pixels, int columns,
               const Activations& small, const Activations& skip) const;
  static float* sums(const PixelConvolution& of, std::byte* block, int i) {
    return reinterpret_cast<float*>(of.output(block, i));
  }

  int channels_;
  PixelConvolution phase_sums_;
  PixelConvolution skip_sums_;
};

/// A decoder's tiles: rows 2 place.row - 1 and columns 2 place.column - 1 on of its output.
class DecoderTile {
 public:
  /// Throws dnnl::error.
  DecoderTile(NetworkLayers& layers, int level, ImageSize phases, BufferLayout& layout);

  ImageSize size() const { return {2 * phases_.height, 2 * phases_.width}; }

  /// Computes the sums of a tile.
  void compute(dnnl::stream& stream, std::byte* block, TilePlace place, const Activations& small,
               const Activations& skip) const;

  /// Row `y` of the image's columns first_x .. end_x - 1, which lie in the tile: for
  /// combine_phases, but for what the image's last row and column have of their own.
  DecoderRow row(std::byte* block, TilePlace place, int y, int first_x, int end_x) const;

 private:
  ImageSize phases_;
  int channels_;
  FusedConvolution phase_sums_;
  FusedConvolution skip_sums_;
  std::size_t small_buffer_, skip_buffer_;            ///< inputs with their surroundings
  std::size_t phase_sums_buffer_, skip_sums_buffer_;  ///< float32
  std::size_t scratch_;
};

// The coarsest ones go by pixels.
inline constexpr int kTiledEncoders = kNetworkLevels - 1;
inline constexpr int kTiledDecoders = kNetworkLevels - 1;
inline constexpr int kBottleneckLayers = 1 + 2 * kResidualBlocks;

/// All of them, and their buffers.
struct TiledLayers {
  /// `layers` must outlive it. Throws dnnl::error.
  explicit TiledLayers(NetworkLayers& layers);

  /// The last layer before its activation: [y, x, channel] float32 of the last decoder's tile,
  /// from what is in `decoded`.
  const float* predict(dnnl::stream& stream, std::byte* block) const;
  float* decoded(std::byte* block) const { return reinterpret_cast<float*>(block + decoded_); }

  BufferLayout layout;
  std::vector<EncoderTile> encoders;       ///< kTiledEncoders
  std::list<PixelConvolution> bottleneck;  ///< kBottleneckLayers: the last encoder, residual blocks
  std::optional<DecoderPixels> first_decoder;
  std::vector<DecoderTile> decoders;  ///< kTiledDecoders, the finest last

 private:
  std::optional<FusedConvolution> prediction_;
  std::size_t decoded_, predicted_, scratch_;
};

/// What has to be computed for the tiles that are wanted.
struct TiledWork {
  std::array<std::vector<TilePlace>, kTiledEncoders> encoders;
  std::array<std::vector<int>, kBottleneckLayers> bottleneck;
  std::vector<int> first_decoder;  ///< pixels of its phases
  std::array<std::vector<TilePlace>, kTiledDecoders> decoders;
  double share = 0;  ///< of the whole image's work, about
};

/// The same by the numbers of winograd.h's tiles, row by row.
struct WinogradWork {
  std::array<std::vector<int>, kNetworkLevels> encoders;
  std::array<std::vector<int>, 2 * kResidualBlocks> residuals;
  std::array<std::vector<int>, kNetworkLevels> decoders;  ///< the finest last
  double share = 0;
};

/// Go back through the network from the wanted pixels. At least one tile must be wanted. Pure.
TiledWork tiled_work(const TileMask& wanted);
WinogradWork winograd_work(const TileMask& wanted);

}  // namespace eventgan
