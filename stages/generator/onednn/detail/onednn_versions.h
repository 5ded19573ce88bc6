#pragma once

#include <dnnl.hpp>
#include <string>
#include <vector>

#include "stages/generator/onednn/layer_numbers.h"

namespace eventgan {

// What oneDNN 2 and 3 want in different ways; the rest of the engine is the same for both.

/// What this processor has, as far as ONEDNN_MAX_CPU_ISA lets oneDNN see. Of arm64 only that oneDNN
/// compiles for it, as SSE 4.1 says of x86-64: its numbers mean other instructions there. Thread
/// safe.
dnnl::cpu_isa this_processor();

/// Whether a processor has these instructions. A later one, of which this build knows nothing, has
/// what its predecessors have.
bool processor_has(dnnl::cpu_isa instructions, dnnl::cpu_isa processor = this_processor());

/// oneDNN's name of all that it finds, "avx512_core_vnni"; "arm64" there.
std::string instruction_set_name();

/// Adds value > 0 ? value : slope * value to what follows a convolution.
void append_relu(dnnl::post_ops& operations, float slope);

/// Layouts (of the weights `any`), and rows and columns of steps and zeros.
struct ConvolutionLayouts {
  dnnl::memory::desc source, weights, bias, target;  ///< bias: a zero layout if there is none
  dnnl::memory::dims strides, before, after;
};

/// A convolution whose sums are multiplied with a layer's output scales, if it has some, before
/// the operations that follow. Version 2 is told the scales now, and adds the bias before them;
/// version 3 takes them when it runs, and adds the bias after them. Throws dnnl::error.
dnnl::convolution_forward::primitive_desc describe_convolution(const ConvolutionLayouts& layouts,
                                                               const LayerNumbers& layer,
                                                               dnnl::primitive_attr attributes,
                                                               const dnnl::engine& engine);

/// What it gets as its bias when it runs: [out], or empty.
std::vector<float> bias_argument(const LayerNumbers& layer);

/// And as scales, under kScalesArgument: [out], or empty where it gets none.
std::vector<float> scales_argument(const LayerNumbers& layer);
extern const int kScalesArgument;

}  // namespace eventgan
