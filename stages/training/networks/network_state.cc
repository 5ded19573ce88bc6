#include "stages/training/networks/detail/network_state.h"

#include <ATen/core/grad_mode.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/gaussian_random.h"

namespace eventgan {
namespace {

/// A number of the wanted distribution for the value at an index.
using Draw = std::function<double(std::uint64_t)>;

void fill(at::Tensor& tensor, const Draw& draw) {
  std::vector<float> values(static_cast<std::size_t>(tensor.numel()));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(draw(i));
  const at::NoGradGuard not_a_step;
  tensor.copy_(at::from_blob(values.data(), tensor.sizes()));
}

Draw normal(CounterRandom random, double deviation) {
  return [=](std::uint64_t i) { return gaussian(random, i, deviation); };
}

Draw uniform(CounterRandom random, double limit) {
  return [=](std::uint64_t i) { return limit * (2 * random.uniform(i) - 1); };
}

double fan_in(const at::Tensor& weight) { return double(weight.numel()) / double(weight.size(0)); }

void fill_unit_vector(at::Tensor& tensor, CounterRandom random) {
  fill(tensor, normal(random, 1));
  tensor.div_(tensor.norm());
}

}  // namespace

void initialize(UNetImpl& network, std::uint64_t seed) {
  constexpr double kGainSquared = 2.0 / (1 + 10 * 10);
  for (auto& item : network.named_parameters()) {
    const CounterRandom random = CounterRandom(seed).keyed(item.key());
    at::Tensor& parameter = item.value();
    if (item.key().ends_with("weight_bar")) {
      fill(parameter, uniform(random, 1 / std::sqrt(fan_in(parameter))));
    } else if (parameter.dim() == 4) {
      fill(parameter, normal(random, std::sqrt(kGainSquared / fan_in(parameter))));
    } else {  // batch norm's scale, or a bias or shift
      const double value = item.key().ends_with(".weight") ? 1 : 0;
      fill(parameter, [=](std::uint64_t) { return value; });
    }
  }
  for (auto& item : network.named_buffers()) {
    at::Tensor& buffer = item.value();
    if (item.key().ends_with("weight_u") || item.key().ends_with("weight_v")) {
      fill_unit_vector(buffer, CounterRandom(seed).keyed(item.key()));
    } else {
      buffer.fill_(item.key().ends_with("running_var") ? 1 : 0);
    }
  }
}

void initialize(PatchDiscriminatorImpl& network, std::uint64_t seed) {
  double limit = 0;
  for (auto& item : network.named_parameters()) {
    at::Tensor& parameter = item.value();
    // A convolution's bias follows its weight and has the same limit.
    if (parameter.dim() == 4) limit = 1 / std::sqrt(fan_in(parameter));
    fill(parameter, uniform(CounterRandom(seed).keyed(item.key()), limit));
  }
}

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

BufferSnapshot::BufferSnapshot(std::initializer_list<torch::nn::Module*> networks) {
  for (torch::nn::Module* network : networks) {
    for (const at::Tensor& buffer : network->buffers()) {
      buffers_.push_back(buffer);
      copies_.push_back(buffer.clone());
    }
  }
}

BufferSnapshot::~BufferSnapshot() {
  const at::NoGradGuard not_a_step;
  for (std::size_t i = 0; i < copies_.size(); ++i) buffers_[i].copy_(copies_[i]);
}

}  // namespace eventgan
