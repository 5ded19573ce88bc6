#pragma once

#include <array>
#include <dnnl.hpp>
#include <map>
#include <string>

#include "manifests/engine.h"
#include "stages/generator/network_shape.h"
#include "stages/generator/onednn/layer_weights_internal.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The network's layers (layer_numbers.h) for one precision, ready for convolutions of any size.
class NetworkLayers {
 public:
  /// kInt8 throws as int8_numbers.
  NetworkLayers(const Weights& weights, Precision precision, const dnnl::engine& engine);

  LayerWeights& at(const std::string& name) { return layers_.at(name); }
  const dnnl::engine& engine() const { return engine_; }
  int base_channels() const { return base_channels_; }
  int bins() const { return bins_; }

  /// What activations between layers are stored as.
  dnnl::memory::data_type stored_type() const { return stored_type_; }
  float residual_factor(int block) const { return residual_factors_[block]; }

 private:
  dnnl::engine engine_;
  int base_channels_;
  int bins_;
  dnnl::memory::data_type stored_type_;
  std::array<float, kResidualBlocks> residual_factors_;
  std::map<std::string, LayerWeights> layers_;
};

}  // namespace eventgan
