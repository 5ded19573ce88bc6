#include <ATen/core/grad_mode.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/training/networks/network_state_internal.h"

namespace eventgan {
namespace {

/// Parameters and buffers, as Python's state_dict() has them.
std::vector<std::pair<std::string, at::Tensor>> named_tensors(const torch::nn::Module& network) {
  std::vector<std::pair<std::string, at::Tensor>> tensors;
  for (const auto& item : network.named_parameters()) tensors.emplace_back(item.pair());
  for (const auto& item : network.named_buffers()) tensors.emplace_back(item.pair());
  return tensors;
}

std::string text(at::IntArrayRef shape) {
  std::ostringstream out;
  out << shape;
  return out.str();
}

const NamedTensor& stored(const StateDict& state, const std::string& key, at::IntArrayRef shape) {
  const auto found = state.find(key);
  if (found == state.end()) {
    throw std::runtime_error("expected a tensor " + key + ", got none, in the network's state");
  }
  const NamedTensor& tensor = found->second;
  if (at::IntArrayRef(tensor.shape) != shape ||
      tensor.values.size() != std::size_t(c10::multiply_integers(shape))) {
    throw std::runtime_error("expected shape " + text(shape) + " of " + key + ", got " +
                             text(tensor.shape) + ", in the network's state");
  }
  return tensor;
}

}  // namespace

void save_network(const torch::nn::Module& network, StateDict& state, const std::string& prefix) {
  for (const auto& [name, tensor] : named_tensors(network)) {
    const at::Tensor values = tensor.detach().to(at::kCPU, at::kFloat).contiguous();
    const float* begin = values.data_ptr<float>();
    state[prefix + name] = {tensor.sizes().vec(), {begin, begin + values.numel()}};
  }
}

void load_network(torch::nn::Module& network, const StateDict& state, const std::string& prefix) {
  auto tensors = named_tensors(network);
  for (const auto& [name, tensor] : tensors) stored(state, prefix + name, tensor.sizes());
  const at::NoGradGuard not_a_step;
  for (auto& [name, tensor] : tensors) {
    const NamedTensor& source = stored(state, prefix + name, tensor.sizes());
    tensor.copy_(at::from_blob(const_cast<float*>(source.values.data()), source.shape));
  }
}

}  // namespace eventgan
