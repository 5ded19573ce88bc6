#include "stages/generator/onednn/detail/fused_convolution.h"

#include <algorithm>

#include "stages/generator/onednn/detail/onednn_versions.h"
#include "stages/generator/weights.h"

namespace eventgan {
namespace {

using Tag = dnnl::memory::format_tag;
using Dimensions = dnnl::memory::dims;

dnnl::post_ops post_operations(const ConvolutionSetup& setup) {
  dnnl::post_ops operations;
  if (setup.add_target != 0) operations.append_sum(setup.add_target);
  if (setup.activation != Activation::kNone) {
    const bool leaky = setup.activation == Activation::kLeakyRelu;
    append_relu(operations, leaky ? kLeakySlope : kNoSlope);
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
  ConvolutionLayouts layouts;
  layouts.source = {source, setup.source_type, Tag::nhwc};
  layouts.target = {target, setup.target_type, Tag::nhwc};
  layouts.weights = {Dimensions{numbers.out_channels, numbers.in_channels, side, side},
                     weights.type(), Tag::any};
  if (!numbers.bias.empty()) layouts.bias = weights.bias().get_desc();
  layouts.strides = {setup.stride, setup.stride};
  layouts.before = {padding.top, padding.left};
  layouts.after = {padding.bottom, padding.right};

  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  // Else the environment (ONEDNN_DEFAULT_FPMATH_MODE) may turn float32 into bfloat16.
  attributes.set_fpmath_mode(dnnl::fpmath_mode::strict);
  attributes.set_post_ops(post_operations(setup));
  return describe_convolution(layouts, numbers, attributes, engine);
}

}  // namespace

FusedConvolution::FusedConvolution(const ConvolutionSetup& setup, LayerWeights& weights,
                                   const dnnl::engine& engine)
    : engine_(engine),
      description_(describe(setup, weights, engine)),
      primitive_(description_),
      weights_(weights.packed(description_.weights_desc())),
      bias_(weights.bias()),
      scales_(weights.scales()) {}

void FusedConvolution::run(dnnl::stream& stream, const void* source, void* target,
                           void* scratch) const {
  // oneDNN takes no const pointers; it reads the source alone.
  const dnnl::memory from(description_.src_desc(), engine_, const_cast<void*>(source));
  const dnnl::memory to(description_.dst_desc(), engine_, target);
  const dnnl::memory scratchpad(description_.scratchpad_desc(), engine_, scratch);
  dnnl_exec_arg_t arguments[6] = {{DNNL_ARG_SRC, from.get()},
                                  {DNNL_ARG_WEIGHTS, weights_.get()},
                                  {DNNL_ARG_DST, to.get()},
                                  {DNNL_ARG_SCRATCHPAD, scratchpad.get()}};
  int count = 4;
  if (bias_.get(true)) arguments[count++] = {DNNL_ARG_BIAS, bias_.get()};
  if (scales_.get(true)) arguments[count++] = {kScalesArgument, scales_.get()};
  dnnl::error::wrap_c_api(dnnl_primitive_execute(primitive_.get(), stream.get(), count, arguments),
                          "expected a convolution to run, got an error");
}

RowConvolution::RowConvolution(const RowConvolutionSetup& setup, LayerWeights& weights,
                               const dnnl::engine& engine)
    : setup_(setup), weights_(&weights), engine_(engine) {}

RowConvolution::InputRows RowConvolution::input_rows(int first_row, int row_count) const {
  const int begin = first_row - setup_.padding;
  const int end = begin + row_count + weights_->numbers().kernel - 1;
  const int first = std::max(begin, 0);
  const int last = std::min(end, setup_.input.height);
  return {first, last - first, first - begin, end - last};
}

void RowConvolution::prepare(int first_row, int row_count) {
  const InputRows rows = input_rows(first_row, row_count);
  if (convolutions_.contains(rows.kind())) return;
  ConvolutionSetup setup;
  setup.input = {rows.count, setup_.input.width};
  setup.padding.top = rows.zeros_above;
  setup.padding.bottom = rows.zeros_below;
  setup.padding.left = setup_.padding;
  setup.padding.right =
      setup_.output.width + weights_->numbers().kernel - 1 - setup_.padding - setup_.input.width;
  setup.source_type = setup_.source_type;
  setup.activation = setup_.activation;
  convolutions_.try_emplace(rows.kind(), setup, *weights_, engine_);
}

void RowConvolution::run(dnnl::stream& stream, int first_row, int row_count, const void* input,
                         float* rows, void* scratch) const {
  const InputRows from = input_rows(first_row, row_count);
  const std::size_t row_bytes = dnnl::memory::data_type_size(setup_.source_type) *
                                setup_.input.width * weights_->numbers().in_channels;
  convolutions_.at(from.kind())
      .run(stream, static_cast<const std::byte*>(input) + from.first * row_bytes, rows, scratch);
}

std::size_t RowConvolution::output_row_bytes() const {
  return sizeof(float) * setup_.output.width * weights_->numbers().out_channels;
}

std::size_t RowConvolution::scratch_bytes() const {
  std::size_t most = 0;
  for (const auto& [kind, convolution] : convolutions_) {
    most = std::max(most, convolution.scratch_bytes());
  }
  return most;
}

void RowConvolution::list_implementations(std::vector<std::string>& names) const {
  for (const auto& [kind, convolution] : convolutions_) {
    names.push_back(convolution.implementation());
  }
}

}  // namespace eventgan
