#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "manifests/image_size.h"
#include "stages/generator/torch/decoder_forward_internal.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// Sees a tensor [1, C, H, W], channels-last, behind its activation: by the name of the
/// convolution that makes it, "resblocks.N" behind the addition. Valid during the call; must not be
/// changed.
using TensorObserver = std::function<void(const std::string& name, const at::Tensor& tensor)>;

/// The generator's network (DESIGN section 4) in LibTorch. Thread safe.
class NetworkForward {
 public:
  /// `type`: what is computed in, at::kFloat or at::kBFloat16. Throws as check_weights;
  /// std::runtime_error if LibTorch fails.
  explicit NetworkForward(const Weights& weights, at::ScalarType type = at::kFloat);

  /// frames: [frame, y, x] float32, C order. Returns [1, 2 bins, H, W] of the type, channels-last.
  /// The calling thread computes with one intra-operation thread from then on. Call under
  /// c10::InferenceMode. Throws c10::Error and whatever the observer throws.
  at::Tensor operator()(std::span<const float> frames, ImageSize size,
                        const TensorObserver& observe = {}) const;

 private:
  struct Layer {
    at::Tensor weight;
    at::Tensor bias;
    int stride = 1;
    int padding = 0;
  };

  at::Tensor convolve(const std::string& name, const at::Tensor& x) const;
  at::Tensor leaky(const std::string& name, const at::Tensor& x,
                   const TensorObserver& observe) const;
  at::Tensor residual(const std::string& block, const at::Tensor& x,
                      const TensorObserver& observe) const;

  at::ScalarType type_;
  std::map<std::string, Layer> layers_;
  std::vector<DecoderForward> decoders_;
};

}  // namespace eventgan
