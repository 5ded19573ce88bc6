#include <algorithm>
#include <utility>

#include "stages/generator/onednn/layer_weights_internal.h"

namespace eventgan {
namespace {

using Tag = dnnl::memory::format_tag;

dnnl::memory bias_memory(std::vector<float>& bias, const dnnl::engine& engine) {
  if (bias.empty()) return {};
  const dnnl::memory::desc layout({static_cast<dnnl::memory::dim>(bias.size())},
                                  dnnl::memory::data_type::f32, Tag::x);
  return {layout, engine, bias.data()};
}

}  // namespace

LayerWeights::LayerWeights(LayerNumbers numbers, dnnl::memory::data_type type,
                           const dnnl::engine& engine)
    : numbers_(std::move(numbers)),
      type_(type),
      engine_(engine),
      bias_(bias_memory(numbers_.bias, engine)) {}

dnnl::memory LayerWeights::packed(const dnnl::memory::desc& layout) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find_if(
      packed_, [&](const dnnl::memory& memory) { return memory.get_desc() == layout; });
  if (found != packed_.end()) return *found;

  const dnnl::memory::desc plain(
      {numbers_.out_channels, numbers_.in_channels, numbers_.kernel, numbers_.kernel},
      dnnl::memory::data_type::f32, Tag::oihw);
  dnnl::memory from(plain, engine_, numbers_.weight.data());
  dnnl::memory to(layout, engine_);
  dnnl::stream stream(engine_);
  dnnl::reorder(from, to).execute(stream, from, to);
  stream.wait();
  packed_.push_back(to);
  return to;
}

}  // namespace eventgan
