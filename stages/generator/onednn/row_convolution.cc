#include <algorithm>

#include "stages/generator/onednn/row_convolution_internal.h"

namespace eventgan {

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
