#pragma once

#include <array>
#include <dnnl.hpp>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/generator/onednn/layer_numbers.h"
#include "stages/generator/onednn/plane_layers.h"
#include "stages/generator/onednn/winograd.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// Sees a tensor of quantized_tensors() (calibration.h), [y, x, channel] float32, behind its
/// activation. Valid during the call.
using TensorObserver = std::function<void(const std::string& name, std::span<const float> values)>;

/// One layer's weights, laid out once for each layout that oneDNN's kernels ask for: a few, shared
/// by all image sizes, and kept. Thread safe.
class LayerWeights {
 public:
  /// `type`: what the weights are converted to (f32, bf16, s8).
  LayerWeights(LayerNumbers numbers, dnnl::memory::data_type type, const dnnl::engine& engine);

  const LayerNumbers& numbers() const { return numbers_; }
  dnnl::memory::data_type type() const { return type_; }

  /// The weights laid out as `layout`, which may be read as long as this or the result lives.
  /// Throws dnnl::error; then nothing is kept.
  dnnl::memory packed(const dnnl::memory::desc& layout);
  /// What a convolution gets beside them (onednn_versions.h); nothing where it gets none.
  const dnnl::memory& bias() const { return bias_; }
  const dnnl::memory& scales() const { return scales_; }

 private:
  LayerNumbers numbers_;
  dnnl::memory::data_type type_;
  dnnl::engine engine_;
  std::vector<float> bias_values_, scale_values_;
  dnnl::memory bias_, scales_;
  std::mutex mutex_;
  std::vector<dnnl::memory> packed_;
};

/// The network's layers as winograd.h computes them.
struct WinogradLayers {
  HeadConvolution head;
  std::vector<WinogradConvolution> encoders;
  std::vector<WinogradConvolution> residuals;  ///< two a block
  std::vector<WinogradConvolution> decoders;
  PlanePrediction prediction;
};

/// The network's layers (layer_numbers.h) for one precision, ready for convolutions of any size.
class NetworkLayers {
 public:
  /// kInt8 throws as int8_numbers.
  NetworkLayers(const Weights& weights, Precision precision, const dnnl::engine& engine);

  LayerWeights& at(const std::string& name) { return layers_.at(name); }
  const dnnl::engine& engine() const { return engine_; }
  int base_channels() const { return base_channels_; }
  int bins() const { return bins_; }
  Precision precision() const { return precision_; }

  /// What activations between layers are stored as.
  dnnl::memory::data_type stored_type() const { return stored_type_; }
  float residual_factor(int block) const { return residual_factors_[block]; }
  /// Where winograd_fits().
  const std::optional<WinogradLayers>& winograd() const { return winograd_; }

 private:
  WinogradLayers winograd_layers() const;

  dnnl::engine engine_;
  int base_channels_;
  int bins_;
  Precision precision_;
  dnnl::memory::data_type stored_type_;
  std::array<float, kResidualBlocks> residual_factors_;
  std::map<std::string, LayerWeights> layers_;
  std::optional<WinogradLayers> winograd_;
};

}  // namespace eventgan
