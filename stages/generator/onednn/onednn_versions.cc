#include "stages/generator/onednn/detail/onednn_versions.h"

#include <dnnl_debug.h>

#include <string_view>

namespace eventgan {

dnnl::cpu_isa this_processor() {
  const dnnl::cpu_isa found = dnnl::get_effective_cpu_isa();
#if defined(__aarch64__)
  return dnnl::cpu_isa{static_cast<int>(found) & static_cast<int>(dnnl::cpu_isa::sse41)};
#else
  return found;
#endif
}

bool processor_has(dnnl::cpu_isa instructions, dnnl::cpu_isa processor) {
  // A bit for each part of what a processor has.
  const auto wanted = static_cast<unsigned>(instructions);
  return (static_cast<unsigned>(processor) & wanted) == wanted;
}

std::string instruction_set_name() {
  if (!processor_has(dnnl::cpu_isa::sse41)) return "none that oneDNN compiles for";
#if defined(__aarch64__)
  return "arm64";
#else
  constexpr std::string_view kPrefix = "cpu_isa_";
  const std::string name = dnnl_cpu_isa2str(dnnl_get_effective_cpu_isa());
  return name.starts_with(kPrefix) ? name.substr(kPrefix.size()) : name;
#endif
}

namespace {

constexpr auto kForward = dnnl::prop_kind::forward_inference;
constexpr auto kDirect = dnnl::algorithm::convolution_direct;
constexpr auto kRelu = dnnl::algorithm::eltwise_relu;

}  // namespace

#if DNNL_VERSION_MAJOR >= 3

void append_relu(dnnl::post_ops& operations, float slope) {
  operations.append_eltwise(kRelu, slope, 0);
}

dnnl::convolution_forward::primitive_desc describe_convolution(const ConvolutionLayouts& layouts,
                                                               const LayerNumbers& layer,
                                                               dnnl::primitive_attr attributes,
                                                               const dnnl::engine& engine) {
  constexpr int kPerOutputChannel = 1 << 0;  // of the weights
  if (!layer.output_scales.empty()) attributes.set_scales_mask(DNNL_ARG_WEIGHTS, kPerOutputChannel);
  const auto& [source, weights, bias, target, strides, before, after] = layouts;
  if (bias.is_zero()) {
    return {engine, kForward, kDirect, source, weights, target, strides, before, after, attributes};
  }
  return {engine, kForward, kDirect, source, weights,   bias,
          target, strides,  before,  after,  attributes};
}

std::vector<float> bias_argument(const LayerNumbers& layer) { return bias_behind_scales(layer); }

std::vector<float> scales_argument(const LayerNumbers& layer) { return layer.output_scales; }

const int kScalesArgument = DNNL_ARG_ATTR_SCALES | DNNL_ARG_WEIGHTS;

#else

void append_relu(dnnl::post_ops& operations, float slope) {
  operations.append_eltwise(1, kRelu, slope, 0);
}

dnnl::convolution_forward::primitive_desc describe_convolution(const ConvolutionLayouts& layouts,
                                                               const LayerNumbers& layer,
                                                               dnnl::primitive_attr attributes,
                                                               const dnnl::engine& engine) {
  constexpr int kPerOutputChannel = 1 << 1;  // of the target
  if (!layer.output_scales.empty())
    attributes.set_output_scales(kPerOutputChannel, layer.output_scales);
  const auto& [source, weights, bias, target, strides, before, after] = layouts;
  if (bias.is_zero()) {
    return {
        {kForward, kDirect, source, weights, target, strides, before, after}, attributes, engine};
  }
  return {{kForward, kDirect, source, weights, bias, target, strides, before, after},
          attributes,
          engine};
}

std::vector<float> bias_argument(const LayerNumbers& layer) { return layer.bias; }

std::vector<float> scales_argument(const LayerNumbers&) { return {}; }

const int kScalesArgument = DNNL_ARG_ATTR_OUTPUT_SCALES;

#endif

}  // namespace eventgan
