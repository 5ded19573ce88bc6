#pragma once

#include <dnnl.hpp>
#include <mutex>
#include <vector>

#include "stages/generator/onednn/numbers/layer_numbers.h"

namespace eventgan {

/// One layer's weights, laid out once for each layout that oneDNN's kernels ask for: a few, shared
/// by all picture sizes, and kept. Thread safe.
class LayerWeights {
 public:
  /// `type`: what the weights are converted to (f32, bf16, s8).
  LayerWeights(LayerNumbers numbers, dnnl::memory::data_type type, const dnnl::engine& engine);

  const LayerNumbers& numbers() const { return numbers_; }
  dnnl::memory::data_type type() const { return type_; }

  /// The weights laid out as `layout`, which may be read as long as this or the result lives.
  /// Throws dnnl::error; then nothing is kept.
  dnnl::memory packed(const dnnl::memory::desc& layout);
  const dnnl::memory& bias() const { return bias_; }

 private:
  LayerNumbers numbers_;
  dnnl::memory::data_type type_;
  dnnl::engine engine_;
  dnnl::memory bias_;
  std::mutex mutex_;
  std::vector<dnnl::memory> packed_;
};

}  // namespace eventgan
