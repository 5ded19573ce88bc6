#include "stages/generator/onednn/detail/tiled_layers.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

namespace eventgan {
namespace {

using Type = dnnl::memory::data_type;

// Larger tiles waste less around them, smaller ones compute less that nobody needs; the coarse
// levels' weights are large, and each tile reads them again.
constexpr std::array<ImageSize, kTiledEncoders> kEncoderTiles = {{{8, 16}, {8, 8}, {4, 8}}};
constexpr std::array<ImageSize, kTiledDecoders> kDecoderPhases = {{{4, 8}, {8, 8}, {8, 16}}};
constexpr int kPixelsAtOnce = 32;

std::string decoder_part(int level, const char* part) {
  return "decoders." + std::to_string(level) + "." + part;
}

/// A convolution without padding over a tile that has its surroundings with it.
FusedConvolution over_tile(NetworkLayers& layers, const std::string& name, ImageSize output,
                           Type type) {
  LayerWeights& weights = layers.at(name);
  const int around = weights.numbers().kernel - 1;
  ConvolutionSetup setup;
  setup.input = {output.height + around, output.width + around};
  setup.source_type = type;
  return FusedConvolution(setup, weights, layers.engine());
}

/// What a tile of an encoder's output sees.
ImageSize encoder_input(ImageSize output) { return {2 * output.height + 1, 2 * output.width + 1}; }

FusedConvolution encoder_convolution(NetworkLayers& layers, int level, ImageSize output) {
  ConvolutionSetup setup;
  setup.input = encoder_input(output);
  setup.stride = 2;
  setup.source_type = setup.target_type = layers.stored_type();
  setup.activation = Activation::kLeakyRelu;
  return FusedConvolution(setup, layers.at("encoders." + std::to_string(level)), layers.engine());
}

std::size_t value_bytes(const NetworkLayers& layers) {
  return dnnl::memory::data_type_size(layers.stored_type());
}

/// Copies the rectangle of `size` whose first pixel is (top, left), which may lie outside: there
/// stand zeros.
void copy_tile(const Activations& from, int top, int left, ImageSize size, std::byte* to) {
  const std::size_t pixel = from.pixel_bytes;
  const int begin = std::clamp(-left, 0, size.width);
  const int end = std::clamp(from.size.width - left, begin, size.width);
  for (int y = top; y < top + size.height; ++y) {
    const std::size_t row_bytes = size.width * pixel;
    if (y < 0 || y >= from.size.height) {
      std::memset(to, 0, row_bytes);
    } else {
      const std::size_t first = static_cast<std::size_t>(y) * from.size.width + left + begin;
      std::memset(to, 0, begin * pixel);
      std::memcpy(to + begin * pixel, from.data + first * pixel, (end - begin) * pixel);
      std::memset(to + end * pixel, 0, (size.width - end) * pixel);
    }
    to += row_bytes;
  }
}

void store(const std::byte* from, std::byte* to, std::size_t bytes, SaturationCount* counted) {
  std::memcpy(to, from, bytes);
  if (counted) counted->add(reinterpret_cast<const std::uint8_t*>(from), bytes);
}

}  // namespace

EncoderTile::EncoderTile(NetworkLayers& layers, int level, ImageSize size, BufferLayout& layout)
    : size_(size), convolution_(encoder_convolution(layers, level, size)) {
  const std::size_t channel_bytes = value_bytes(layers) * (layers.base_channels() << level);
  input_ = layout.add(encoder_input(size).pixel_count() * channel_bytes);
  output_ = layout.add(size.pixel_count() * 2 * channel_bytes);
  scratch_ = layout.add(convolution_.scratch_bytes());
}

void EncoderTile::run(dnnl::stream& stream, std::byte* block, TilePlace place,
                      const Activations& source, const Activations& target,
                      SaturationCount* counted) const {
  copy_tile(source, 2 * place.row - 1, 2 * place.column - 1, encoder_input(size_), block + input_);
  convolution_.run(stream, block + input_, block + output_, block + scratch_);
  const int rows = std::min(size_.height, target.size.height - place.row);
  const int columns = std::min(size_.width, target.size.width - place.column);
  for (int y = 0; y < rows; ++y) {
    const std::size_t to =
        static_cast<std::size_t>(place.row + y) * target.size.width + place.column;
    store(block + output_ + static_cast<std::size_t>(y) * size_.width * target.pixel_bytes,
          target.data + to * target.pixel_bytes, columns * target.pixel_bytes, counted);
  }
}

namespace {

/// A kernel [out, in, y, x] as one of 1x1 over the channels of all pixels that it sees, [out, y, x,
/// in].
LayerNumbers side_by_side(LayerNumbers numbers) {
  const int taps = numbers.kernel * numbers.kernel;
  std::vector<float> weight(numbers.weight.size());
  std::size_t at = 0;
  for (int out = 0; out < numbers.out_channels; ++out) {
    for (int tap = 0; tap < taps; ++tap) {
      for (int in = 0; in < numbers.in_channels; ++in) {
        weight[at++] =
            numbers.weight[(static_cast<std::size_t>(out) * numbers.in_channels + in) * taps + tap];
      }
    }
  }
  numbers.weight = std::move(weight);
  numbers.in_channels *= taps;
  numbers.kernel = 1;
  return numbers;
}

ConvolutionSetup pixels_setup(ConvolutionSetup setup, int count) {
  setup.input = {1, count};
  setup.stride = 1;
  return setup;
}

}  // namespace

PixelConvolution::PixelConvolution(NetworkLayers& layers, const std::string& name,
                                   ConvolutionSetup setup, int count, BufferLayout& layout)
    : weights_(side_by_side(layers.at(name).numbers()), layers.at(name).type(), layers.engine()),
      side_(layers.at(name).numbers().kernel),
      stride_(setup.stride),
      count_(count),
      adds_(setup.add_target != 0),
      convolution_(pixels_setup(setup, count), weights_, layers.engine()),
      output_bytes_(dnnl::memory::data_type_size(setup.target_type) *
                    weights_.numbers().out_channels) {
  input_ = layout.add(dnnl::memory::data_type_size(setup.source_type) * count *
                      weights_.numbers().in_channels);
  output_ = layout.add(output_bytes_ * count);
  scratch_ = layout.add(convolution_.scratch_bytes());
}

void PixelConvolution::gather(std::byte* block, int i, int y, int x,
                              const Activations& source) const {
  copy_tile(source, stride_ * y - 1, stride_ * x - 1, {side_, side_},
            block + input_ + static_cast<std::size_t>(i) * side_ * side_ * source.pixel_bytes);
}

void PixelConvolution::run(dnnl::stream& stream, std::byte* block, const std::vector<int>& pixels,
                           const Activations& source, const Activations& target,
                           SaturationCount* counted) const {
  const auto in_target = [&](int pixel) { return target.data + pixel * target.pixel_bytes; };
  for (std::size_t first = 0; first < pixels.size(); first += count_) {
    const int count = static_cast<int>(std::min<std::size_t>(count_, pixels.size() - first));
    for (int i = 0; i < count; ++i) {
      const int pixel = pixels[first + i];
      gather(block, i, pixel / target.size.width, pixel % target.size.width, source);
      if (adds_) std::memcpy(output(block, i), in_target(pixel), output_bytes_);
    }
    compute(stream, block);
    for (int i = 0; i < count; ++i) {
      store(output(block, i), in_target(pixels[first + i]), output_bytes_, counted);
    }
  }
}

namespace {

ConvolutionSetup sums_setup(const NetworkLayers& layers) {
  ConvolutionSetup setup;
  setup.source_type = layers.stored_type();
  return setup;
}

}  // namespace

DecoderPixels::DecoderPixels(NetworkLayers& layers, int level, BufferLayout& layout)
    : channels_(layers.at(decoder_part(level, "skip")).numbers().out_channels),
      phase_sums_(layers, decoder_part(level, "phases"), sums_setup(layers), kAtOnce, layout),
      skip_sums_(layers, decoder_part(level, "skip"), sums_setup(layers), 4 * kAtOnce, layout) {}

void DecoderPixels::compute(dnnl::stream& stream, std::byte* block, std::span<const int> pixels,
                            int columns, const Activations& small, const Activations& skip) const {
  for (int i = 0; i < static_cast<int>(pixels.size()); ++i) {
    const int row = pixels[static_cast<std::size_t>(i)] / columns;
    const int column = pixels[static_cast<std::size_t>(i)] % columns;
    phase_sums_.gather(block, i, row, column, small);
    for (int child = 0; child < 4; ++child) {
      skip_sums_.gather(block, 4 * i + child, 2 * row - 1 + child / 2, 2 * column - 1 + child % 2,
                        skip);
    }
  }
  phase_sums_.compute(stream, block);
  skip_sums_.compute(stream, block);
}

DecoderTile::DecoderTile(NetworkLayers& layers, int level, ImageSize phases, BufferLayout& layout)
    : phases_(phases),
      channels_(layers.at(decoder_part(level, "skip")).numbers().out_channels),
      phase_sums_(over_tile(layers, decoder_part(level, "phases"), phases, layers.stored_type())),
      skip_sums_(over_tile(layers, decoder_part(level, "skip"), size(), layers.stored_type())) {
  const std::size_t value = value_bytes(layers);
  const std::size_t pixels = phases.pixel_count();
  small_buffer_ = layout.add(value * (phases.height + 1) * (phases.width + 1) *
                             layers.at(decoder_part(level, "phases")).numbers().in_channels);
  skip_buffer_ = layout.add(value * (size().height + 2) * (size().width + 2) * channels_);
  phase_sums_buffer_ = layout.add(sizeof(float) * 4 * channels_ * pixels);
  skip_sums_buffer_ = layout.add(sizeof(float) * 4 * channels_ * pixels);
  scratch_ = layout.add(std::max(phase_sums_.scratch_bytes(), skip_sums_.scratch_bytes()));
}

void DecoderTile::compute(dnnl::stream& stream, std::byte* block, TilePlace place,
                          const Activations& small, const Activations& skip) const {
  // Phase pixel p sees the small image's p - 1 and p; output pixel y the skip's y - 1 to y + 1.
  copy_tile(small, place.row - 1, place.column - 1, {phases_.height + 1, phases_.width + 1},
            block + small_buffer_);
  copy_tile(skip, 2 * place.row - 2, 2 * place.column - 2, {size().height + 2, size().width + 2},
            block + skip_buffer_);
  phase_sums_.run(stream, block + small_buffer_, block + phase_sums_buffer_, block + scratch_);
  skip_sums_.run(stream, block + skip_buffer_, block + skip_sums_buffer_, block + scratch_);
}

DecoderRow DecoderTile::row(std::byte* block, TilePlace place, int y, int first_x,
                            int end_x) const {
  DecoderRow row;
  row.width = end_x - first_x;
  row.channels = channels_;
  row.row_phase = y % 2;
  row.column_phase = first_x % 2;
  const std::ptrdiff_t pixel =
      (y - (2 * place.row - 1)) * size().width + first_x - (2 * place.column - 1);
  const std::ptrdiff_t phase =
      ((y + 1) / 2 - place.row) * phases_.width + (first_x + 1) / 2 - place.column;
  row.skip = reinterpret_cast<float*>(block + skip_sums_buffer_) + pixel * channels_;
  row.phases = reinterpret_cast<const float*>(block + phase_sums_buffer_) + phase * 4 * channels_;
  return row;
}

TiledLayers::TiledLayers(NetworkLayers& layers) {
  for (int level = 0; level < kTiledEncoders; ++level) {
    encoders.emplace_back(layers, level, kEncoderTiles[static_cast<std::size_t>(level)], layout);
  }
  ConvolutionSetup setup;
  setup.source_type = setup.target_type = layers.stored_type();
  setup.stride = 2;
  setup.activation = Activation::kLeakyRelu;
  bottleneck.emplace_back(layers, "encoders." + std::to_string(kTiledEncoders), setup,
                          kPixelsAtOnce, layout);
  setup.stride = 1;
  setup.activation = Activation::kRelu;
  for (int block = 0; block < kResidualBlocks; ++block) {
    const std::string name = "resblocks." + std::to_string(block);
    setup.add_target = 0;
    bottleneck.emplace_back(layers, name + ".conv1", setup, kPixelsAtOnce, layout);
    setup.add_target = layers.residual_factor(block);
    bottleneck.emplace_back(layers, name + ".conv2", setup, kPixelsAtOnce, layout);
  }
  first_decoder.emplace(layers, 0, layout);
  for (int level = 1; level < kNetworkLevels; ++level) {
    decoders.emplace_back(layers, level, kDecoderPhases[static_cast<std::size_t>(level - 1)],
                          layout);
  }
  const ImageSize size = decoders.back().size();
  prediction_ = over_tile(layers, "pred", size, Type::f32);
  const LayerNumbers& numbers = layers.at("pred").numbers();
  decoded_ = layout.add(sizeof(float) * size.pixel_count() * numbers.in_channels);
  predicted_ = layout.add(sizeof(float) * size.pixel_count() * numbers.out_channels);
  scratch_ = layout.add(prediction_->scratch_bytes());
}

const float* TiledLayers::predict(dnnl::stream& stream, std::byte* block) const {
  prediction_->run(stream, block + decoded_, block + predicted_, block + scratch_);
  return reinterpret_cast<const float*>(block + predicted_);
}

namespace {

/// Rows (or columns) first..last of an image.
struct Range {
  int first = 0;
  int last = 0;
};

/// What a decoder reads of the small image for these rows of its output.
Range below_decoder(Range range) { return {(range.first - 1) >> 1, (range.last + 1) >> 1}; }

/// What an encoder reads of the large image.
Range above_encoder(Range range) { return {2 * range.first - 1, 2 * range.last + 1}; }

/// What a convolution reads of an image of the same size.
Range around(Range range) { return {range.first - 1, range.last + 1}; }

/// Pixels of an image that are needed.
class NeededPixels {
 public:
  explicit NeededPixels(ImageSize size) : size_(size), needed_(size.pixel_count()) {}

  ImageSize size() const { return size_; }

  /// Beyond the image nothing is.
  void add(Range rows, Range columns) {
    const int left = std::max(columns.first, 0);
    const int right = std::min(columns.last, size_.width - 1);
    for (int y = std::max(rows.first, 0); y <= std::min(rows.last, size_.height - 1); ++y) {
      std::fill_n(needed_.begin() + at(y, left), std::max(right + 1 - left, 0), std::uint8_t{1});
    }
  }

  /// Those that `reads` says another image's needed pixels read.
  void add_read_by(const NeededPixels& other, Range (*reads)(Range)) {
    other.visit_runs([&](int y, Range columns) { add(reads({y, y}), reads(columns)); });
  }

  /// Calls visit(y, columns) for each run of needed pixels, row by row.
  template <class Visit>
  void visit_runs(Visit&& visit) const {
    for (int y = 0; y < size_.height; ++y) {
      const std::uint8_t* row = needed_.data() + at(y, 0);
      const std::uint8_t* end = row + size_.width;
      for (const std::uint8_t* first = std::find(row, end, 1); first != end;) {
        const std::uint8_t* last = std::find(first, end, 0);
        visit(y, Range{static_cast<int>(first - row), static_cast<int>(last - row) - 1});
        first = std::find(last, end, 1);
      }
    }
  }

 private:
  std::size_t at(int y, int x) const { return static_cast<std::size_t>(y) * size_.width + x; }

  ImageSize size_;
  std::vector<std::uint8_t> needed_;
};

/// The tiles of `tile` pixels that hold the needed ones, whose place in the grid `in_grid` gives.
std::vector<TilePlace> places_of(const NeededPixels& needed, ImageSize tile, ImageSize grid,
                                 int (*in_grid)(int)) {
  NeededPixels tiles(
      {(grid.height + tile.height - 1) / tile.height, (grid.width + tile.width - 1) / tile.width});
  needed.visit_runs([&](int y, Range columns) {
    const int row = in_grid(y) / tile.height;
    tiles.add({row, row},
              {in_grid(columns.first) / tile.width, in_grid(columns.last) / tile.width});
  });
  std::vector<TilePlace> places;
  tiles.visit_runs([&](int row, Range columns) {
    for (int column = columns.first; column <= columns.last; ++column) {
      places.push_back({row * tile.height, column * tile.width});
    }
  });
  return places;
}

std::vector<TilePlace> encoder_places(const NeededPixels& needed, ImageSize tile) {
  return places_of(needed, tile, needed.size(), [](int pixel) { return pixel; });
}

std::vector<TilePlace> decoder_places(const NeededPixels& needed, ImageSize phases) {
  const ImageSize grid{needed.size().height / 2 + 1, needed.size().width / 2 + 1};
  return places_of(needed, phases, grid, [](int pixel) { return (pixel + 1) / 2; });
}

std::vector<int> pixels_of(const NeededPixels& needed) {
  std::vector<int> pixels;
  needed.visit_runs([&](int y, Range columns) {
    for (int x = columns.first; x <= columns.last; ++x) {
      pixels.push_back(y * needed.size().width + x);
    }
  });
  return pixels;
}

/// Those of a decoder's phases that hold needed pixels of its output.
std::vector<int> phase_pixels(const NeededPixels& needed) {
  NeededPixels phases({needed.size().height / 2 + 1, needed.size().width / 2 + 1});
  phases.add_read_by(needed, [](Range range) {
    return Range{(range.first + 1) / 2, (range.last + 1) / 2};
  });
  return pixels_of(phases);
}

/// Those of an image of half the size that hold needed pixels.
std::vector<int> quad_pixels(const NeededPixels& needed) {
  NeededPixels quads(half_size(needed.size()));
  quads.add_read_by(needed, [](Range range) { return Range{range.first / 2, range.last / 2}; });
  return pixels_of(quads);
}

/// Multiplications in units of the square of the base width.
double work_of(const TiledWork& work) {
  const auto count = [](std::size_t tiles, ImageSize size) {
    return static_cast<double>(tiles * size.pixel_count());
  };
  double sum = 0;
  for (std::size_t level = 0; level < kTiledEncoders; ++level) {
    const double channels = 1 << level;
    sum += count(work.encoders[level].size(), kEncoderTiles[level]) * 18 * channels * channels;
  }
  constexpr double kBottom = 1 << kNetworkLevels;  // channels, in base widths
  constexpr double kKernelTaps = 9;
  for (std::size_t layer = 0; layer < kBottleneckLayers; ++layer) {
    const double of_pixel =
        layer == 0 ? kKernelTaps * kBottom * kBottom / 2 : kKernelTaps * kBottom * kBottom;
    sum += static_cast<double>(work.bottleneck[layer].size()) * of_pixel;
  }
  // Of a pixel of the phases 4 x 4 from twice as many channels, and 4 x 9 beside it.
  constexpr double kPhasePixel = 68, kFirst = kBottom / 2;
  sum += static_cast<double>(work.first_decoder.size()) * kPhasePixel * kFirst * kFirst;
  for (std::size_t tiled = 0; tiled < kTiledDecoders; ++tiled) {
    const double channels = 1 << (kTiledDecoders - 1 - tiled);
    sum += count(work.decoders[tiled].size(), kDecoderPhases[tiled]) * kPhasePixel * channels *
           channels;
  }
  return sum;
}

/// What is needed of the layers' outputs.
struct NeededOutputs {
  std::vector<NeededPixels> decoders;    ///< the finest first
  std::vector<NeededPixels> bottleneck;  ///< kBottleneckLayers
  std::vector<NeededPixels> encoders;    ///< but the last one's
};

NeededOutputs needed_outputs(const TileMask& wanted) {
  NeededOutputs needed;
  std::vector<NeededPixels>& levels = needed.decoders;
  for (ImageSize size = wanted.size; levels.size() < kNetworkLevels; size = half_size(size)) {
    levels.emplace_back(size);
  }
  wanted.visit_tiles(true, [&](const TileMask::Pixels& tile) {
    levels[0].add({tile.top, tile.bottom - 1}, {tile.left, tile.right - 1});
  });
  for (std::size_t level = 1; level < kNetworkLevels; ++level) {
    levels[level].add_read_by(levels[level - 1], below_decoder);
  }
  needed.bottleneck.assign(kBottleneckLayers, NeededPixels(half_size(levels.back().size())));
  needed.bottleneck.back().add_read_by(levels.back(), below_decoder);
  for (std::size_t layer = kBottleneckLayers - 1; layer > 0; --layer) {
    needed.bottleneck[layer - 1].add_read_by(needed.bottleneck[layer], around);
  }
  // Skip connections are read by the decoder beside them and by the next encoder.
  for (std::size_t level = 1; level < kNetworkLevels; ++level) {
    needed.encoders.emplace_back(levels[level].size());
  }
  for (std::size_t level = kTiledEncoders; level > 0; --level) {
    NeededPixels& skip = needed.encoders[level - 1];
    skip.add_read_by(levels[level], around);
    skip.add_read_by(level == kTiledEncoders ? needed.bottleneck[0] : needed.encoders[level],
                     above_encoder);
  }
  return needed;
}

}  // namespace

TiledWork tiled_work(const TileMask& wanted) {
  const NeededOutputs needed = needed_outputs(wanted);
  TiledWork work;
  work.first_decoder = phase_pixels(needed.decoders.back());
  for (std::size_t tiled = 0; tiled < kTiledDecoders; ++tiled) {
    work.decoders[tiled] =
        decoder_places(needed.decoders[kTiledDecoders - 1 - tiled], kDecoderPhases[tiled]);
  }
  std::ranges::transform(needed.bottleneck, work.bottleneck.begin(), pixels_of);
  for (std::size_t level = 0; level < kTiledEncoders; ++level) {
    work.encoders[level] = encoder_places(needed.encoders[level], kEncoderTiles[level]);
  }

  constexpr double kWholeWork = 18 + 36 + 68;  // encoders, residual blocks, decoders; of a pixel
  constexpr double kFixedWork = 4;             // head, clearing
  constexpr double kTileCost = 1.25;
  const auto pixels = static_cast<double>(wanted.size.pixel_count());
  work.share =
      (kTileCost * work_of(work) + kFixedWork * pixels) / ((kWholeWork + kFixedWork) * pixels);
  return work;
}

WinogradWork winograd_work(const TileMask& wanted) {
  const NeededOutputs needed = needed_outputs(wanted);
  // Products of a tile's channels in units of the square of the base width.
  constexpr double kEncoder = 25 * 2, kResidual = 16 << 2 * kNetworkLevels, kDecoder = 16 + 9 * 2;
  double some = 0, all = 0;
  const auto count = [&](const std::vector<int>& tiles, ImageSize grid, double products) {
    some += products * static_cast<double>(tiles.size());
    all += products * static_cast<double>(grid.pixel_count());
  };
  WinogradWork work;
  const ImageSize coarsest = half_size(needed.bottleneck[0].size());
  for (std::size_t level = 0; level < kNetworkLevels; ++level) {
    const double channels = 1 << level;
    const NeededPixels& encoded =
        level < kTiledEncoders ? needed.encoders[level] : needed.bottleneck[0];
    work.encoders[level] = quad_pixels(encoded);
    count(work.encoders[level], half_size(encoded.size()), kEncoder * channels * channels);
    const NeededPixels& decoded = needed.decoders[level];
    std::vector<int>& decoder = work.decoders[kNetworkLevels - 1 - level];
    decoder = phase_pixels(decoded);
    count(decoder, {decoded.size().height / 2 + 1, decoded.size().width / 2 + 1},
          kDecoder * channels * channels);
  }
  for (std::size_t layer = 0; layer < work.residuals.size(); ++layer) {
    work.residuals[layer] = quad_pixels(needed.bottleneck[layer + 1]);
    count(work.residuals[layer], coarsest, kResidual);
  }
  constexpr double kFixedWork = 6;  // head, clearing; of a pixel
  const double fixed = kFixedWork * static_cast<double>(wanted.size.pixel_count());
  work.share = (some + fixed) / (all + fixed);
  return work;
}

}  // namespace eventgan
