#pragma once

#include <cstddef>
#include <dnnl.hpp>
#include <string>

#include "manifests/image_size.h"
#include "stages/generator/onednn/layer_weights_internal.h"

namespace eventgan {

/// Rows and columns of zeros around a convolution's input.
struct ZeroPadding {
  int top = 0;
  int bottom = 0;
  int left = 0;
  int right = 0;
};

enum class Activation { kNone, kRelu, kLeakyRelu };

struct ConvolutionSetup {
  ImageSize input;
  ZeroPadding padding;
  int stride = 1;
  dnnl::memory::data_type source_type = dnnl::memory::data_type::f32;
  dnnl::memory::data_type target_type = dnnl::memory::data_type::f32;
  Activation activation = Activation::kNone;
  /// Not 0: adds this times what stands in the target, before the activation.
  float add_target = 0;
};

/// activation(convolution(source) + bias [+ add_target target]) for one shape, source and target
/// [y, x, channel] without gaps. Holds no buffers; thread safe.
///
/// kRelu lets NaN through, as LibTorch's does; what is below zero becomes 1e-30 of itself.
class FusedConvolution {
 public:
  /// `weights` must outlive it. Throws dnnl::error.
  FusedConvolution(const ConvolutionSetup& setup, LayerWeights& weights,
                   const dnnl::engine& engine);

  /// The caller's thread computes. `scratch`: scratch_bytes().
  void run(dnnl::stream& stream, const void* source, void* target, void* scratch) const;

  ImageSize output() const;
  std::size_t scratch_bytes() const { return description_.scratchpad_desc().get_size(); }

  /// oneDNN's name of the kernel: "brgconv:avx512_core".
  std::string implementation() const { return description_.impl_info_str(); }

 private:
  dnnl::engine engine_;
  dnnl::convolution_forward::primitive_desc description_;
  dnnl::convolution_forward primitive_;
  dnnl::memory weights_;
  dnnl::memory bias_;
};

}  // namespace eventgan
