#include <algorithm>
#include <stdexcept>
#include <utility>

#include "stages/generator/calibration/quantized_kernel.h"
#include "stages/generator/onednn/network_layers_internal.h"
#include "stages/generator/onednn/numbers/layer_numbers.h"
#include "stages/generator/onednn/onednn_support.h"

namespace eventgan {
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
      stored_type_(stored_type_of(precision)) {
  NetworkNumbers numbers = numbers_of(weights, precision);
  std::ranges::copy(numbers.residual_factors, residual_factors_.begin());
  for (LayerNumbers& layer : numbers.layers) {
    const std::string name = layer.name;
    const Type type = is_float32_layer(name) ? Type::f32 : weights_type_of(precision);
    layers_.try_emplace(name, std::move(layer), type, engine_);
  }
}

}  // namespace eventgan
