#pragma once

#include <array>
#include <cstddef>
#include <dnnl.hpp>
#include <map>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/onednn/detail/network_layers.h"

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
  /// Not 0: adds this times what is in the target, before the activation.
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

  std::size_t scratch_bytes() const { return description_.scratchpad_desc().get_size(); }

  /// oneDNN's name of the kernel: "brgconv:avx512_core".
  std::string implementation() const { return description_.impl_info_str(); }

 private:
  dnnl::engine engine_;
  dnnl::convolution_forward::primitive_desc description_;
  dnnl::convolution_forward primitive_;
  dnnl::memory weights_;
  dnnl::memory bias_;
  dnnl::memory scales_;
};

struct RowConvolutionSetup {
  ImageSize input;
  ImageSize output;
  /// Output row r reads input rows from r - padding on, columns likewise; zeros beyond the image.
  int padding = 0;
  dnnl::memory::data_type source_type = dnnl::memory::data_type::f32;
  Activation activation = Activation::kNone;
};

/// A convolution of stride 1 whose float32 output is wanted some rows at a time, so that it stays
/// in the cache until it is used. Thread safe but for `prepare`.
class RowConvolution {
 public:
  /// `weights` must outlive it.
  RowConvolution(const RowConvolutionSetup& setup, LayerWeights& weights,
                 const dnnl::engine& engine);

  /// Makes `run` possible for these output rows; rows of one kind share what is built. Throws
  /// dnnl::error.
  void prepare(int first_row, int row_count);

  /// input: the whole image [y, x, channel]; rows: [row_count, x, channel] float32.
  void run(dnnl::stream& stream, int first_row, int row_count, const void* input, float* rows,
           void* scratch) const;

  std::size_t output_row_bytes() const;
  std::size_t scratch_bytes() const;
  void list_implementations(std::vector<std::string>& names) const;

 private:
  struct InputRows {
    int first = 0;
    int count = 0;
    int zeros_above = 0;
    int zeros_below = 0;
    std::array<int, 3> kind() const { return {count, zeros_above, zeros_below}; }
  };
  InputRows input_rows(int first_row, int row_count) const;

  RowConvolutionSetup setup_;
  LayerWeights* weights_;
  dnnl::engine engine_;
  std::map<std::array<int, 3>, FusedConvolution> convolutions_;
};

}  // namespace eventgan
