#pragma once

#include <algorithm>
#include <cstddef>
#include <dnnl.hpp>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/onednn/activation_rows.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/detail/fused_convolution.h"
#include "stages/generator/onednn/detail/network_layers.h"
#include "stages/generator/onednn/detail/tiled_layers.h"

namespace eventgan {

/// What a run works with: a stream of the calling thread and its block of buffers.
struct EngineRun {
  dnnl::stream& stream;
  std::byte* block = nullptr;  ///< what BufferLayout's offsets count from
  std::byte* scratch = nullptr;
  SaturationCount& saturation;  ///< of all activations that the run stores
  bool& sound;                  ///< GenerationNotes::sound
  std::byte* tiles = nullptr;   ///< TiledLayers' buffers, where it is used
};

/// One decoder for one image size: the sums of its convolutions over the doubled image and over
/// the skip connection, strip by strip, so that they stay in the cache until they are combined.
class DecoderLevel {
 public:
  /// `large` is the skip connection's size; the small one is half of it, rounded up. by_strips:
  /// else there are none, but edges, tiles and pixels. Adds its buffers to `layout`. Throws
  /// dnnl::error.
  DecoderLevel(NetworkLayers& layers, int level, ImageSize large, bool by_strips,
               BufferLayout& layout);

  const std::vector<DecoderStrip>& strips() const { return strips_; }
  int most_rows() const { return most_rows_; }
  int channels() const { return channels_; }

  /// Before the strips: what the last row and column of an odd size need. small: [y, x, channel].
  void compute_edges(const EngineRun& run, const std::byte* small) const;

  /// After it row() gives the strip's rows, each for one combine_phases. skip: [y, x, channel].
  void compute(const EngineRun& run, const DecoderStrip& strip, const std::byte* small,
               const std::byte* skip) const;

  DecoderRow row(const EngineRun& run, const DecoderStrip& strip, int y) const;

  /// Where the phases do not hold what begins at pixel first_x of row y: whole_row, last_pixel.
  void add_edges(const EngineRun& run, int y, int first_x, DecoderRow& row) const;

  /// In place of strips: computes a tile, and calls visit(y, first_x, DecoderRow) for each of its
  /// rows in the image.
  template <class Visit>
  void compute_tile(const EngineRun& run, const DecoderTile& tile, TilePlace place,
                    std::byte* small, std::byte* skip, Visit&& visit) const {
    tile.compute(run.stream, run.tiles, place, {small, small_, small_pixel_bytes_},
                 {skip, large_, skip_pixel_bytes_});
    const int first_x = std::max(2 * place.column - 1, 0);
    const int end_x = std::min(2 * place.column - 1 + tile.size().width, large_.width);
    const int end_y = std::min(2 * place.row - 1 + tile.size().height, large_.height);
    for (int y = std::max(2 * place.row - 1, 0); y < end_y; ++y) {
      DecoderRow row = tile.row(run.tiles, place, y, first_x, end_x);
      add_edges(run, y, first_x, row);
      visit(y, first_x, row);
    }
  }

  /// The same by pixels of the phases: visit(y, x, DecoderRow) for each pixel of theirs.
  template <class Visit>
  void compute_pixels(const EngineRun& run, const DecoderPixels& pixels,
                      const std::vector<int>& numbers, std::byte* small, std::byte* skip,
                      Visit&& visit) const {
    pixels.run(run.stream, run.tiles, numbers, {small, small_, small_pixel_bytes_},
               {skip, large_, skip_pixel_bytes_}, [&](int y, int x, DecoderRow row) {
                 add_edges(run, y, x, row);
                 visit(y, x, row);
               });
  }

  std::size_t scratch_bytes() const;
  void list_implementations(std::vector<std::string>& names) const;

 private:
  /// The last row (column) of the doubled image with the one before it, and what comes of it.
  struct Edge {
    RowConvolution convolution;
    int row_count = 0;  ///< 2; 1 where there is no row before it
    std::size_t input = 0;
    std::size_t output = 0;
  };
  Edge make_edge(NetworkLayers& layers, const std::string& name, int across, int along,
                 BufferLayout& layout) const;
  void gather(const std::byte* small, int row, int column, std::byte* pixel) const;
  void run_edge(const EngineRun& run, const Edge& edge) const;

  ImageSize small_;
  ImageSize large_;
  int channels_;
  std::size_t small_pixel_bytes_;
  std::size_t skip_pixel_bytes_;
  RowConvolution phases_;
  RowConvolution skip_;
  std::optional<Edge> last_row_;
  std::optional<Edge> last_column_;
  std::vector<DecoderStrip> strips_;
  int most_rows_ = 0;
  std::size_t phase_buffer_ = 0;
  std::size_t skip_buffer_ = 0;
};

}  // namespace eventgan
