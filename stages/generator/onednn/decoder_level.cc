#include "stages/generator/onednn/detail/decoder_level.h"

#include <algorithm>
#include <cstring>

namespace eventgan {
namespace {

/// A strip's sums should stay in the second-level cache of the processors of the last ten years.
constexpr std::size_t kStripBytes = std::size_t{1} << 19;

std::string layer_name(int level, const char* part) {
  return "decoders." + std::to_string(level) + "." + part;
}

/// Phase rows and columns that hold all of `large`.
ImageSize phase_size(ImageSize large) { return {large.height / 2 + 1, large.width / 2 + 1}; }

/// Each strip reads all weights again: it should be worth it.
int phase_rows_of_strip(std::size_t row_bytes, std::size_t weights_bytes) {
  return static_cast<int>(std::max<std::size_t>(
      2, std::max(kStripBytes, 2 * weights_bytes) / std::max<std::size_t>(row_bytes, 1)));
}

RowConvolutionSetup setup_of(ImageSize input, ImageSize output, dnnl::memory::data_type type) {
  RowConvolutionSetup setup;
  setup.input = input;
  setup.output = output;
  setup.padding = 1;
  setup.source_type = type;
  return setup;
}

}  // namespace

DecoderLevel::DecoderLevel(NetworkLayers& layers, int level, ImageSize large, bool by_strips,
                           BufferLayout& layout)
    : small_(half_size(large)),
      large_(large),
      channels_(layers.at(layer_name(level, "skip")).numbers().out_channels),
      small_pixel_bytes_(dnnl::memory::data_type_size(layers.stored_type()) *
                         layers.at(layer_name(level, "phases")).numbers().in_channels),
      skip_pixel_bytes_(dnnl::memory::data_type_size(layers.stored_type()) * channels_),
      phases_(setup_of(small_, phase_size(large), layers.stored_type()),
              layers.at(layer_name(level, "phases")), layers.engine()),
      skip_(setup_of(large, large, layers.stored_type()), layers.at(layer_name(level, "skip")),
            layers.engine()) {
  const LayerNumbers& phases = layers.at(layer_name(level, "phases")).numbers();
  const std::size_t weights_bytes =
      phases.weight.size() * dnnl::memory::data_type_size(layers.stored_type());
  if (by_strips) {
    strips_ = decoder_strips(large.height,
                             phase_rows_of_strip(phases_.output_row_bytes(), weights_bytes));
  }
  int most_phase_rows = 0;
  for (const DecoderStrip& strip : strips_) {
    phases_.prepare(strip.first_phase_row, strip.phase_row_count);
    skip_.prepare(strip.first_row, strip.row_count);
    most_rows_ = std::max(most_rows_, strip.row_count);
    most_phase_rows = std::max(most_phase_rows, strip.phase_row_count);
  }
  phase_buffer_ = layout.add(most_phase_rows * phases_.output_row_bytes());
  skip_buffer_ = layout.add(most_rows_ * skip_.output_row_bytes());
  if (large.height % 2 == 1) {
    last_row_ = make_edge(layers, layer_name(level, "last_row"), large.height, large.width, layout);
  }
  if (large.width % 2 == 1) {
    last_column_ =
        make_edge(layers, layer_name(level, "last_column"), large.width, large.height, layout);
  }
}

DecoderLevel::Edge DecoderLevel::make_edge(NetworkLayers& layers, const std::string& name,
                                           int across, int along, BufferLayout& layout) const {
  const int rows = std::min(across, 2);
  const ImageSize size{rows, along};
  Edge edge{
      RowConvolution(setup_of(size, size, layers.stored_type()), layers.at(name), layers.engine()),
      rows};
  edge.convolution.prepare(rows - 1, 1);
  edge.input = layout.add(size.pixel_count() * small_pixel_bytes_);
  edge.output = layout.add(edge.convolution.output_row_bytes());
  return edge;
}

void DecoderLevel::gather(const std::byte* small, int row, int column, std::byte* pixel) const {
  const std::size_t from = static_cast<std::size_t>(row / 2) * small_.width + column / 2;
  std::memcpy(pixel, small + from * small_pixel_bytes_, small_pixel_bytes_);
}

void DecoderLevel::run_edge(const EngineRun& run, const Edge& edge) const {
  edge.convolution.run(run.stream, edge.row_count - 1, 1, run.block + edge.input,
                       reinterpret_cast<float*>(run.block + edge.output), run.scratch);
}

void DecoderLevel::compute_edges(const EngineRun& run, const std::byte* small) const {
  if (last_row_) {
    std::byte* pixel = run.block + last_row_->input;
    for (int y = large_.height - last_row_->row_count; y < large_.height; ++y) {
      for (int x = 0; x < large_.width; ++x, pixel += small_pixel_bytes_)
        gather(small, y, x, pixel);
    }
    run_edge(run, *last_row_);
  }
  if (last_column_) {
    std::byte* pixel = run.block + last_column_->input;
    for (int x = large_.width - last_column_->row_count; x < large_.width; ++x) {
      for (int y = 0; y < large_.height; ++y, pixel += small_pixel_bytes_)
        gather(small, y, x, pixel);
    }
    run_edge(run, *last_column_);
  }
}

void DecoderLevel::compute(const EngineRun& run, const DecoderStrip& strip, const std::byte* small,
                           const std::byte* skip) const {
  phases_.run(run.stream, strip.first_phase_row, strip.phase_row_count, small,
              reinterpret_cast<float*>(run.block + phase_buffer_), run.scratch);
  skip_.run(run.stream, strip.first_row, strip.row_count, skip,
            reinterpret_cast<float*>(run.block + skip_buffer_), run.scratch);
}

DecoderRow DecoderLevel::row(const EngineRun& run, const DecoderStrip& strip, int y) const {
  DecoderRow row;
  row.width = large_.width;
  row.channels = channels_;
  row.row_phase = y % 2;
  row.skip = reinterpret_cast<float*>(run.block + skip_buffer_ +
                                      (y - strip.first_row) * skip_.output_row_bytes());
  row.phases = reinterpret_cast<const float*>(run.block + phase_buffer_ +
                                              ((y + 1) / 2 - strip.first_phase_row) *
                                                  phases_.output_row_bytes());
  add_edges(run, y, 0, row);
  return row;
}

void DecoderLevel::add_edges(const EngineRun& run, int y, int first_x, DecoderRow& row) const {
  if (last_row_ && y == large_.height - 1) {
    row.whole_row = reinterpret_cast<const float*>(run.block + last_row_->output) +
                    static_cast<std::ptrdiff_t>(first_x) * channels_;
  }
  if (last_column_ && first_x + row.width == large_.width) {
    row.last_pixel = reinterpret_cast<const float*>(run.block + last_column_->output) +
                     static_cast<std::ptrdiff_t>(y) * channels_;
  }
}

std::size_t DecoderLevel::scratch_bytes() const {
  std::size_t most = std::max(phases_.scratch_bytes(), skip_.scratch_bytes());
  if (last_row_) most = std::max(most, last_row_->convolution.scratch_bytes());
  if (last_column_) most = std::max(most, last_column_->convolution.scratch_bytes());
  return most;
}

void DecoderLevel::list_implementations(std::vector<std::string>& names) const {
  phases_.list_implementations(names);
  skip_.list_implementations(names);
  if (last_row_) last_row_->convolution.list_implementations(names);
  if (last_column_) last_column_->convolution.list_implementations(names);
}

}  // namespace eventgan
