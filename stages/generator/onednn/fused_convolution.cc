#include "stages/generator/network_shape.h"
#include "stages/generator/onednn/fused_convolution_internal.h"

namespace eventgan {
namespace {

using Tag = dnnl::memory::format_tag;
using Dimensions = dnnl::memory::dims;

/// With a slope of 0 oneDNN takes the larger of value and 0, which turns NaN into 0. With another
/// it multiplies. Small enough to vanish in every sum of float32 or bfloat16, and far from
/// subnormal.
constexpr float kNoSlope = 1e-30f;

dnnl::post_ops post_operations(const ConvolutionSetup& setup) {
  dnnl::post_ops operations;
  if (setup.add_target != 0) operations.append_sum(setup.add_target);
  if (setup.activation != Activation::kNone) {
    const bool leaky = setup.activation == Activation::kLeakyRelu;
    operations.append_eltwise(1.0f, dnnl::algorithm::eltwise_relu, leaky ? kLeakySlope : kNoSlope,
                              0.0f);
  }
  return operations;
}

int output_side(int input, int padding, int kernel, int stride) {
  return (input + padding - kernel) / stride + 1;
}

dnnl::convolution_forward::primitive_desc describe(const ConvolutionSetup& setup,
                                                   const LayerWeights& weights,
                                                   const dnnl::engine& engine) {
  const LayerNumbers& numbers = weights.numbers();
  const ZeroPadding& padding = setup.padding;
  const int side = numbers.kernel;
  const Dimensions source = {1, numbers.in_channels, setup.input.height, setup.input.width};
  const Dimensions target = {
      1, numbers.out_channels,
      output_side(setup.input.height, padding.top + padding.bottom, side, setup.stride),
      output_side(setup.input.width, padding.left + padding.right, side, setup.stride)};
  const dnnl::memory::desc source_layout(source, setup.source_type, Tag::nhwc);
  const dnnl::memory::desc target_layout(target, setup.target_type, Tag::nhwc);
  const dnnl::memory::desc weights_layout(
      Dimensions{numbers.out_channels, numbers.in_channels, side, side}, weights.type(), Tag::any);
  const Dimensions strides = {setup.stride, setup.stride};
  const Dimensions before = {padding.top, padding.left};
  const Dimensions after = {padding.bottom, padding.right};

  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  attributes.set_post_ops(post_operations(setup));
  if (!numbers.output_scales.empty()) {
    constexpr int kPerOutputChannel = 1 << 1;
    attributes.set_output_scales(kPerOutputChannel, numbers.output_scales);
  }
  const auto forward = dnnl::prop_kind::forward_inference;
  const auto direct = dnnl::algorithm::convolution_direct;
  if (numbers.bias.empty()) {
    return {{forward, direct, source_layout, weights_layout, target_layout, strides, before, after},
            attributes,
            engine};
  }
  const dnnl::memory::desc& bias_layout = weights.bias().get_desc();
  return {{forward, direct, source_layout, weights_layout, bias_layout, target_layout, strides,
           before, after},
          attributes,
          engine};
}

}  // namespace

FusedConvolution::FusedConvolution(const ConvolutionSetup& setup, LayerWeights& weights,
                                   const dnnl::engine& engine)
    : engine_(engine),
      description_(describe(setup, weights, engine)),
      primitive_(description_),
      weights_(weights.packed(description_.weights_desc())),
      bias_(weights.bias()) {}

ImageSize FusedConvolution::output() const {
  const Dimensions sides = description_.dst_desc().dims();
  return {static_cast<int>(sides[2]), static_cast<int>(sides[3])};
}

void FusedConvolution::run(dnnl::stream& stream, const void* source, void* target,
                           void* scratch) const {
  // oneDNN takes no const pointers; it reads the source alone.
  const dnnl::memory from(description_.src_desc(), engine_, const_cast<void*>(source));
  const dnnl::memory to(description_.dst_desc(), engine_, target);
  const dnnl::memory scratchpad(description_.scratchpad_desc(), engine_, scratch);
  const dnnl_exec_arg_t arguments[] = {{DNNL_ARG_SRC, from.get()},
                                       {DNNL_ARG_WEIGHTS, weights_.get()},
                                       {DNNL_ARG_DST, to.get()},
                                       {DNNL_ARG_SCRATCHPAD, scratchpad.get()},
                                       {DNNL_ARG_BIAS, bias_.get(true)}};
  const int count = bias_.get(true) ? 5 : 4;
  dnnl::error::wrap_c_api(dnnl_primitive_execute(primitive_.get(), stream.get(), count, arguments),
                          "expected a convolution to run, got an error");
}

}  // namespace eventgan
