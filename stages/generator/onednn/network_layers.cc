#include "stages/generator/onednn/detail/network_layers.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "stages/generator/onednn/detail/onednn_versions.h"
#include "stages/generator/onednn/layer_numbers.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/quantized_network.h"

namespace eventgan {
namespace {

using Tag = dnnl::memory::format_tag;

dnnl::memory memory_of(std::vector<float>& values, const dnnl::engine& engine) {
  if (values.empty()) return {};
  const dnnl::memory::desc layout({static_cast<dnnl::memory::dim>(values.size())},
                                  dnnl::memory::data_type::f32, Tag::x);
  return {layout, engine, values.data()};
}

}  // namespace

LayerWeights::LayerWeights(LayerNumbers numbers, dnnl::memory::data_type type,
                           const dnnl::engine& engine)
    : numbers_(std::move(numbers)),
      type_(type),
      engine_(engine),
      bias_values_(bias_argument(numbers_)),
      scale_values_(scales_argument(numbers_)),
      bias_(memory_of(bias_values_, engine)),
      scales_(memory_of(scale_values_, engine)) {}

dnnl::memory LayerWeights::packed(const dnnl::memory::desc& layout) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find_if(
      packed_, [&](const dnnl::memory& memory) { return memory.get_desc() == layout; });
  if (found != packed_.end()) return *found;

  const dnnl::memory::desc plain(
      {numbers_.out_channels, numbers_.in_channels, numbers_.kernel, numbers_.kernel},
      dnnl::memory::data_type::f32, Tag::oihw);
  dnnl::memory from(plain, engine_, numbers_.weight.data());
  dnnl::memory to(layout, engine_);
  dnnl::stream stream(engine_);
  dnnl::reorder(from, to).execute(stream, from, to);
  stream.wait();
  packed_.push_back(to);
  return to;
}

namespace {

using Type = dnnl::memory::data_type;

Type stored_type_of(Precision precision) {
  switch (precision) {
    case Precision::kFloat32:
      return Type::f32;
    case Precision::kBfloat16:
      return Type::bf16;
    case Precision::kInt8:
      return Type::u8;
  }
  throw std::logic_error("unknown precision");
}

Type weights_type_of(Precision precision) {
  return precision == Precision::kInt8 ? Type::s8 : stored_type_of(precision);
}

NetworkNumbers numbers_of(const Weights& weights, Precision precision) {
  if (precision != Precision::kInt8) return float_numbers(weights);
  return int8_numbers(
      weights, onednn_support(precision).native ? kLargestWeight : kLargestWeightWithoutVnni);
}

}  // namespace

NetworkLayers::NetworkLayers(const Weights& weights, Precision precision,
                             const dnnl::engine& engine)
    : engine_(engine),
      base_channels_(weights.base_channels),
      bins_(weights.bins),
      precision_(precision),
      stored_type_(stored_type_of(precision)) {
  NetworkNumbers numbers = numbers_of(weights, precision);
  std::ranges::copy(numbers.residual_factors, residual_factors_.begin());
  for (LayerNumbers& layer : numbers.layers) {
    const std::string name = layer.name;
    const Type type = is_float32_layer(name) ? Type::f32 : weights_type_of(precision);
    layers_.try_emplace(name, std::move(layer), type, engine_);
  }
  if (winograd_fits(base_channels_, precision_)) winograd_ = winograd_layers();
}

WinogradLayers NetworkLayers::winograd_layers() const {
  const auto numbers = [&](const std::string& name) -> const LayerNumbers& {
    return layers_.at(name).numbers();
  };
  WinogradLayers layers{
      HeadConvolution(numbers("head")), {}, {}, {}, PlanePrediction(numbers("pred"))};
  for (int block = 0; block < kResidualBlocks; ++block) {
    for (const char* part : {".conv1", ".conv2"}) {
      layers.residuals.emplace_back(numbers("resblocks." + std::to_string(block) + part), 1,
                                    kNoSlope);
    }
  }
  for (int level = 0; level < kNetworkLevels; ++level) {
    const std::string number = std::to_string(level), decoder = "decoders." + number;
    layers.encoders.emplace_back(numbers("encoders." + number), 2, kLeakySlope);
    layers.decoders.emplace_back(numbers(decoder + ".skip"), 1, kLeakySlope,
                                 &numbers(decoder + ".last_row"));
  }
  return layers;
}

}  // namespace eventgan
