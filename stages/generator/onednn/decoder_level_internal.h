#pragma once

#include <cstddef>
#include <dnnl.hpp>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/onednn/activation_rows.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/fused_convolution_internal.h"
#include "stages/generator/onednn/network_layers_internal.h"

namespace eventgan {

/// What a run works with: a stream of the calling thread and its block of buffers.
struct EngineRun {
  dnnl::stream& stream;
  std::byte* block = nullptr;  ///< what BufferLayout's offsets count from
  std::byte* scratch = nullptr;
};

/// One decoder for one picture size: the sums of its convolutions over the doubled picture and over
/// the skip connection, strip by strip, so that they stay in the cache until they are combined.
class DecoderLevel {
 public:
  /// `large` is the skip connection's size; the small one is half of it, rounded up. Adds its
  /// buffers to `layout`. Throws dnnl::error.
  DecoderLevel(NetworkLayers& layers, int level, ImageSize large, BufferLayout& layout);

  const std::vector<DecoderStrip>& strips() const { return strips_; }
  int most_rows() const { return most_rows_; }
  int channels() const { return channels_; }

  /// Before the strips: what the last row and column of an odd size need. small: [y, x, channel].
  void compute_edges(const EngineRun& run, const std::byte* small) const;

  /// After it row() gives the strip's rows, each for one combine_phases. skip: [y, x, channel].
  void compute(const EngineRun& run, const DecoderStrip& strip, const std::byte* small,
               const std::byte* skip) const;

  DecoderRow row(const EngineRun& run, const DecoderStrip& strip, int y) const;

  std::size_t scratch_bytes() const;
  void list_implementations(std::vector<std::string>& names) const;

 private:
  /// The last row (column) of the doubled picture with the one before it, and what comes of it.
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
