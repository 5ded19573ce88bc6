#pragma once

#include <string>
#include <vector>

#include "stages/generator/weights.h"

namespace eventgan {

/// Numbers of one convolution as the engine computes it.
struct LayerNumbers {
  std::string name;
  int out_channels = 0;
  int in_channels = 0;
  int kernel = 0;             ///< side in pixels
  std::vector<float> weight;  ///< [out, in, y, x]; for int8 whole numbers -127..127
  std::vector<float> bias;    ///< [out]; empty: none
  /// int8: [out], what the sum of products and bias is multiplied with: the bias has been divided
  /// by this. Empty: 1.
  std::vector<float> output_scales;
};

/// The bias, to be added to what the scales have made: times output_scales. [out], or empty.
std::vector<float> bias_behind_scales(const LayerNumbers& layer);

/// The network's layers. Names are those of network_layout(), but each decoder has
///   decoders.N.skip         3x3 over the skip connection, with the layer's bias
///   decoders.N.phases       2x2 over the small image (decoder_kernels.h)
///   decoders.N.last_row     3x3 over the doubled image, for the last row of an odd height
///   decoders.N.last_column  the same with rows and columns exchanged, for an odd width
/// none of which has an activation: their sum has. `head` and `pred` are float32 in every
/// precision, since they cost little and their rounding errors go straight into the volume.
struct NetworkNumbers {
  std::vector<LayerNumbers> layers;
  /// What a residual block's input is multiplied with before it is added to the block's output.
  float residual_factors[2] = {1, 1};
};

/// For float32 and bfloat16.
NetworkNumbers float_numbers(const Weights& weights);

/// For int8, in units of each tensor's step: a layer's result is what is stored, but for rounding;
/// that of the last decoder is real. `largest_weight` as quantize_kernel takes it. Throws
/// std::invalid_argument without weights.calibration, or if quantize_kernel refuses a layer or its
/// numbers leave float32; else as quantize_network.
NetworkNumbers int8_numbers(const Weights& weights, int largest_weight);

/// Whether a layer is float32 in every precision: `head` and `pred`.
bool is_float32_layer(const std::string& name);

}  // namespace eventgan
