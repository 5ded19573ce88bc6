#include "stages/generator/onednn/detail/network_plan.h"

#include <omp.h>

#include <algorithm>
#include <stdexcept>
#include <type_traits>

#include "stages/generator/onednn/detail/onednn_versions.h"

namespace eventgan {
namespace {

using Type = dnnl::memory::data_type;

/// Rows of the head's float32 output that are held until they are stored.
constexpr std::size_t kHeadStripBytes = std::size_t{1} << 19;

std::string numbered(const char* name, int number) {
  return std::string(name) + "." + std::to_string(number);
}

}  // namespace

OneOpenMpThread::OneOpenMpThread() : threads_before_(omp_get_max_threads()) {
  omp_set_num_threads(1);
}

OneOpenMpThread::~OneOpenMpThread() { omp_set_num_threads(threads_before_); }

NetworkPlan::NetworkPlan(NetworkLayers& layers, ImageSize size)
    : engine_(layers.engine()),
      size_(size),
      base_channels_(layers.base_channels()),
      bins_(layers.bins()),
      stored_type_(layers.stored_type()) {
  if (layers.winograd()) {
    winograd_.emplace(*layers.winograd(), base_channels_, size_, layout_);
    return;
  }
  const bool narrow = NarrowLayers::fit(base_channels_, layers.precision());
  skips_[0] = add_activations(size_, base_channels_);
  if (narrow) {
    plan_narrow(layers);
  } else {
    plan_head(layers);
  }
  plan_encoders(layers);
  plan_residual_blocks(layers);
  plan_decoders(layers);
  if (!narrow) plan_prediction(layers);

  std::size_t scratch_bytes =
      prediction_ ? std::max(head_->scratch_bytes(), prediction_->scratch_bytes()) : 0;
  for (const auto* list : {&encoders_, &residuals_}) {
    for (const FusedConvolution& convolution : *list) {
      scratch_bytes = std::max(scratch_bytes, convolution.scratch_bytes());
    }
  }
  for (const DecoderLevel& decoder : decoders_) {
    scratch_bytes = std::max(scratch_bytes, decoder.scratch_bytes());
  }
  scratch_ = layout_.add(scratch_bytes);
}

NetworkPlan::Buffer NetworkPlan::add_activations(ImageSize size, int channels) {
  const std::size_t bytes =
      size.pixel_count() * channels * dnnl::memory::data_type_size(stored_type_);
  return {layout_.add(bytes), bytes};
}

void NetworkPlan::plan_narrow(NetworkLayers& layers) {
  // For a row of the head. It also is what a row written to the end of skips_[0] reaches into.
  const std::size_t pixels = size_.width + NarrowLayers::kPixels;
  head_rows_buffer_ = layout_.add(pixels * NarrowLayers::kChannels * sizeof(float));
  const auto numbers = [&](const std::string& name) { return layers.at(name).numbers(); };
  const bool tiles = stored_type_ == Type::bf16 && processor_has(dnnl::cpu_isa::avx512_core_amx);
  const auto stored_bytes = static_cast<int>(dnnl::memory::data_type_size(stored_type_));
  narrow_.emplace(numbers("head"), numbers("decoders.3.skip"), numbers("decoders.3.phases"),
                  numbers("pred"), size_, stored_bytes, tiles, layout_);
}

void NetworkPlan::plan_head(NetworkLayers& layers) {
  RowConvolutionSetup setup;
  setup.input = setup.output = size_;
  setup.padding = 1;
  setup.activation = Activation::kLeakyRelu;
  RowConvolution& head = head_.emplace(setup, layers.at("head"), engine_);
  inputs_ = layers.at("head").numbers().in_channels;
  input_ = layout_.add(inputs_ * size_.pixel_count() * sizeof(float));
  // Float32 activations are written where they stay.
  head_rows_ = stored_type_ == Type::f32
                   ? size_.height
                   : static_cast<int>(std::clamp<std::size_t>(
                         kHeadStripBytes / head.output_row_bytes(), 1, size_.height));
  for (int row = 0; row < size_.height; row += head_rows_) {
    head.prepare(row, std::min(head_rows_, size_.height - row));
  }
  if (stored_type_ != Type::f32) {
    head_rows_buffer_ = layout_.add(head_rows_ * head.output_row_bytes());
  }
}

void NetworkPlan::plan_encoders(NetworkLayers& layers) {
  ImageSize size = size_;
  for (int level = 0; level < kNetworkLevels; ++level) {
    sizes_[level] = size;
    if (level > 0) skips_[level] = add_activations(size, base_channels_ << level);
    ConvolutionSetup setup;
    setup.input = size;
    setup.padding = {1, 1, 1, 1};
    setup.stride = 2;
    setup.source_type = setup.target_type = stored_type_;
    setup.activation = Activation::kLeakyRelu;
    // oneDNN takes the padding after the last pixel as given, also where no stride reaches it.
    encoders_.emplace_back(setup, layers.at(numbered("encoders", level)), engine_);
    size = half_size(size);
  }
  bottleneck_ = add_activations(size, base_channels_ << kNetworkLevels);
  between_ = add_activations(size, base_channels_ << kNetworkLevels);
}

void NetworkPlan::plan_residual_blocks(NetworkLayers& layers) {
  for (int block = 0; block < kResidualBlocks; ++block) {
    ConvolutionSetup setup;
    setup.input = half_size(sizes_.back());
    setup.padding = {1, 1, 1, 1};
    setup.source_type = setup.target_type = stored_type_;
    setup.activation = Activation::kRelu;
    const std::string name = numbered("resblocks", block);
    residuals_.emplace_back(setup, layers.at(name + ".conv1"), engine_);
    setup.add_target = layers.residual_factor(block);
    residuals_.emplace_back(setup, layers.at(name + ".conv2"), engine_);
  }
}

void NetworkPlan::plan_decoders(NetworkLayers& layers) {
  for (int level = 0; level < kNetworkLevels; ++level) {
    const ImageSize large = sizes_[kNetworkLevels - 1 - level];
    const bool by_strips = level < kNetworkLevels - 1 || !narrow_;
    decoders_.emplace_back(layers, level, large, by_strips, layout_);
    if (level < kNetworkLevels - 1) {
      decoded_[level] = add_activations(large, decoders_[level].channels());
    }
  }
}

void NetworkPlan::plan_prediction(NetworkLayers& layers) {
  const DecoderLevel& last = decoders_.back();
  RowConvolutionSetup setup;
  setup.input = setup.output = {last.most_rows(), size_.width};
  RowConvolution& prediction = prediction_.emplace(setup, layers.at("pred"), engine_);
  for (const DecoderStrip& strip : last.strips()) prediction.prepare(0, strip.row_count);
  decoded_rows_ = layout_.add(sizeof(float) * last.most_rows() * size_.width * last.channels());
  predicted_rows_ = layout_.add(last.most_rows() * prediction.output_row_bytes());
}

template <class Stored>
void NetworkPlan::run_head(const EngineRun& run, const float* planes) const {
  auto* stored = reinterpret_cast<Stored*>(run.block + skips_[0].offset);
  const std::size_t row_values = static_cast<std::size_t>(size_.width) * base_channels_;
  if (narrow_) {
    for (int y = 0; y < size_.height; ++y) {
      Stored* const row = stored + y * row_values;
      if constexpr (std::is_same_v<Stored, float>) {
        narrow_->head_row(planes, y, run.block, row);
      } else {
        auto* const values = reinterpret_cast<float*>(run.block + head_rows_buffer_);
        narrow_->head_row(planes, y, run.block, values);
        store_activations(values, row_values, row);
        run.saturation.add(row, row_values);
      }
    }
    return;
  }
  auto* input = reinterpret_cast<float*>(run.block + input_);
  const std::size_t pixels = size_.pixel_count();
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t plane = 0; plane < inputs_; ++plane) {
      input[inputs_ * i + plane] = planes[plane * pixels + i];
    }
  }
  if constexpr (std::is_same_v<Stored, float>) {
    head_->run(run.stream, 0, size_.height, input, stored, run.scratch);
    return;
  }
  auto* rows = reinterpret_cast<float*>(run.block + head_rows_buffer_);
  for (int row = 0; row < size_.height; row += head_rows_) {
    const int count = std::min(head_rows_, size_.height - row);
    head_->run(run.stream, row, count, input, rows, run.scratch);
    store_activations(rows, count * row_values, stored + row * row_values);
    run.saturation.add(stored + row * row_values, count * row_values);
  }
}

template <class Stored>
void NetworkPlan::run_decoder(const EngineRun& run, int level, const std::byte* small) const {
  const DecoderLevel& decoder = decoders_[level];
  const std::byte* skip = run.block + skips_[kNetworkLevels - 1 - level].offset;
  auto* stored = reinterpret_cast<Stored*>(run.block + decoded_[level].offset);
  decoder.compute_edges(run, small);
  for (const DecoderStrip& strip : decoder.strips()) {
    decoder.compute(run, strip, small, skip);
    for (int y = strip.first_row; y < strip.first_row + strip.row_count; ++y) {
      const DecoderRow row = decoder.row(run, strip, y);
      const std::size_t row_values = static_cast<std::size_t>(row.width) * row.channels;
      combine_phases(row, stored + y * row_values);
      run.saturation.add(stored + y * row_values, row_values);
    }
  }
}

template <class Stored>
void NetworkPlan::run_last_decoder(const EngineRun& run, const std::byte* small,
                                   float* volume) const {
  const DecoderLevel& decoder = decoders_.back();
  const std::byte* skip = run.block + skips_[0].offset;
  auto* decoded = reinterpret_cast<float*>(run.block + decoded_rows_);
  auto* predicted = reinterpret_cast<float*>(run.block + predicted_rows_);
  const std::ptrdiff_t row_values = static_cast<std::ptrdiff_t>(size_.width) * decoder.channels();
  decoder.compute_edges(run, small);
  if (narrow_) {
    for (int y = 0; y < size_.height; ++y) {
      DecoderRow edges;
      edges.width = size_.width;
      decoder.add_edges(run, y, 0, edges);
      run.sound &=
          narrow_->volume_row(reinterpret_cast<const Stored*>(small),
                              reinterpret_cast<const Stored*>(skip), edges, y, run.block, volume);
    }
    return;
  }
  for (const DecoderStrip& strip : decoder.strips()) {
    decoder.compute(run, strip, small, skip);
    for (int y = 0; y < strip.row_count; ++y) {
      combine_phases(decoder.row(run, strip, strip.first_row + y), decoded + y * row_values);
    }
    prediction_->run(run.stream, 0, strip.row_count, decoded, predicted, run.scratch);
    run.sound &= rectify_into_planes(
        predicted, static_cast<std::size_t>(strip.row_count) * size_.width, 2 * bins_,
        volume + static_cast<std::ptrdiff_t>(strip.first_row) * size_.width, size_.pixel_count());
  }
}

template <class Compute>
void NetworkPlan::with_stored_type(Compute&& compute) const {
  switch (stored_type_) {
    case Type::f32:
      return compute(float());
    case Type::bf16:
      return compute(Bfloat16());
    case Type::u8:
      return compute(std::uint8_t());
    default:
      throw std::logic_error("unknown type of activations");
  }
}

GenerationNotes NetworkPlan::run(const float* planes, float* volume, std::byte* block,
                                 const TensorObserver& observe) const {
  if (winograd_) return winograd_->run(planes, volume, block, observe);
  dnnl::stream stream(engine_);
  SaturationCount saturation;
  bool sound = true;
  const EngineRun run{stream, block, block + scratch_, saturation, sound};
  const auto at = [&](const Buffer& buffer) { return block + buffer.offset; };
  with_stored_type([&]<class Stored>(Stored) {
    const auto values_of = [&](const Buffer& buffer) {
      return std::span(reinterpret_cast<const Stored*>(at(buffer)),
                       buffer.size_bytes / sizeof(Stored));
    };
    const auto show = [&](const std::string& name, const Buffer& buffer) {
      if constexpr (std::is_same_v<Stored, float>) {
        if (observe) observe(name, values_of(buffer));
      }
    };
    const auto count_and_show = [&](const std::string& name, const Buffer& buffer) {
      saturation.add(values_of(buffer).data(), values_of(buffer).size());
      show(name, buffer);
    };
    run_head<Stored>(run, planes);
    show("head", skips_[0]);
    for (int level = 0; level < kNetworkLevels; ++level) {
      const Buffer& target = level + 1 < kNetworkLevels ? skips_[level + 1] : bottleneck_;
      encoders_[level].run(stream, at(skips_[level]), at(target), run.scratch);
      count_and_show(numbered("encoders", level), target);
    }
    for (int i = 0; i < kResidualBlocks; ++i) {
      const std::string name = numbered("resblocks", i);
      residuals_[2 * i].run(stream, at(bottleneck_), at(between_), run.scratch);
      count_and_show(name + ".conv1", between_);
      residuals_[2 * i + 1].run(stream, at(between_), at(bottleneck_), run.scratch);
      count_and_show(name, bottleneck_);
    }
    const std::byte* small = at(bottleneck_);
    for (int level = 0; level < kNetworkLevels - 1; ++level) {
      run_decoder<Stored>(run, level, small);
      show(numbered("decoders", level), decoded_[level]);
      small = at(decoded_[level]);
    }
    run_last_decoder<Stored>(run, small, volume);
  });
  return {.saturated_share = saturation.share(), .sound = sound};
}

template <class Stored>
void NetworkPlan::run_decoder_tiles(const EngineRun& run, const TiledLayers& layers,
                                    const TiledWork& work, int level, std::byte* small) const {
  const DecoderLevel& decoder = decoders_[level];
  std::byte* skip = run.block + skips_[kNetworkLevels - 1 - level].offset;
  auto* stored = reinterpret_cast<Stored*>(run.block + decoded_[level].offset);
  const std::ptrdiff_t width = sizes_[kNetworkLevels - 1 - level].width;
  const auto store = [&](int y, int first_x, const DecoderRow& row) {
    Stored* part = stored + (y * width + first_x) * row.channels;
    combine_phases(row, part);
    run.saturation.add(part, static_cast<std::size_t>(row.width) * row.channels);
  };
  decoder.compute_edges(run, small);
  if (level == 0) {
    decoder.compute_pixels(run, *layers.first_decoder, work.first_decoder, small, skip, store);
    return;
  }
  for (const TilePlace place : work.decoders[level - 1]) {
    decoder.compute_tile(run, layers.decoders[level - 1], place, small, skip, store);
  }
}

void NetworkPlan::run_last_tiles(const EngineRun& run, const TiledLayers& layers,
                                 const TiledWork& work, const TileMask& wanted, std::byte* small,
                                 float* volume) const {
  const DecoderLevel& decoder = decoders_.back();
  const DecoderTile& tile = layers.decoders.back();
  std::byte* skip = run.block + skips_[0].offset;
  float* decoded = layers.decoded(run.tiles);
  decoder.compute_edges(run, small);
  for (const TilePlace place : work.decoders.back()) {
    const int top = 2 * place.row - 1;
    const int left = 2 * place.column - 1;
    const auto pixel_at = [&](int y, int x) {
      return static_cast<std::ptrdiff_t>(y - top) * tile.size().width + x - left;
    };
    decoder.compute_tile(run, tile, place, small, skip,
                         [&](int y, int first_x, const DecoderRow& row) {
                           combine_phases(row, decoded + pixel_at(y, first_x) * row.channels);
                         });
    const float* predicted = layers.predict(run.stream, run.tiles);
    const TileMask::Pixels piece{std::max(top, 0), std::min(top + tile.size().height, size_.height),
                                 std::max(left, 0),
                                 std::min(left + tile.size().width, size_.width)};
    wanted.visit_within(piece, [&](const TileMask::Pixels& pixels) {
      for (int y = pixels.top; y < pixels.bottom; ++y) {
        run.sound &=
            rectify_into_planes(predicted + pixel_at(y, pixels.left) * 2 * bins_,
                                static_cast<std::size_t>(pixels.right - pixels.left), 2 * bins_,
                                volume + static_cast<std::ptrdiff_t>(y) * size_.width + pixels.left,
                                size_.pixel_count());
      }
    });
  }
}

GenerationNotes NetworkPlan::run_tiles(const TiledLayers& layers, const TiledWork& work,
                                       const TileMask& wanted, const float* planes, float* volume,
                                       std::byte* block, std::byte* tiles) const {
  dnnl::stream stream(engine_);
  SaturationCount saturation;
  SaturationCount* counted = stored_type_ == Type::u8 ? &saturation : nullptr;
  bool sound = true;
  const EngineRun run{stream, block, block + scratch_, saturation, sound, tiles};
  const std::size_t value = dnnl::memory::data_type_size(stored_type_);
  const auto skip = [&](int level) {
    return Activations{block + skips_[level].offset, sizes_[level],
                       value * (static_cast<std::size_t>(base_channels_) << level)};
  };
  const auto at_bottleneck = [&](const Buffer& buffer) {
    return Activations{block + buffer.offset, half_size(sizes_.back()),
                       value * (static_cast<std::size_t>(base_channels_) << kNetworkLevels)};
  };
  with_stored_type([&]<class Stored>(Stored) {
    run_head<Stored>(run, planes);
    for (int level = 0; level < kTiledEncoders; ++level) {
      for (const TilePlace place : work.encoders[level]) {
        layers.encoders[level].run(stream, tiles, place, skip(level), skip(level + 1), counted);
      }
    }
    // The last encoder, then the blocks' first and second convolutions in turns.
    Activations source = skip(kTiledEncoders);
    Activations target = at_bottleneck(bottleneck_);
    auto pixels = work.bottleneck.begin();
    for (const PixelConvolution& convolution : layers.bottleneck) {
      convolution.run(stream, tiles, *pixels++, source, target, counted);
      source = target;
      target = at_bottleneck(source.data == block + bottleneck_.offset ? between_ : bottleneck_);
    }
    std::byte* small = block + bottleneck_.offset;
    for (int level = 0; level < kNetworkLevels - 1; ++level) {
      run_decoder_tiles<Stored>(run, layers, work, level, small);
      small = block + decoded_[level].offset;
    }
    run_last_tiles(run, layers, work, wanted, small, volume);
  });
  return {.saturated_share = saturation.share(), .sound = sound};
}

std::vector<std::string> NetworkPlan::implementations() const {
  std::vector<std::string> names;
  if (head_) head_->list_implementations(names);
  for (const auto* list : {&encoders_, &residuals_}) {
    for (const FusedConvolution& convolution : *list) names.push_back(convolution.implementation());
  }
  for (const DecoderLevel& decoder : decoders_) decoder.list_implementations(names);
  if (prediction_) prediction_->list_implementations(names);
  return names;
}

std::shared_ptr<const NetworkPlan> PlanCache::plan(ImageSize size) {
  return plans_.get({size.height, size.width},
                    [&] { return std::make_shared<const NetworkPlan>(layers_, size); });
}

}  // namespace eventgan
