#include "stages/training/radam.h"

#include <ATen/ops/from_blob.h>
#include <ATen/ops/zeros_like.h>
#include <c10/core/GradMode.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

// Step t = 1, 2, ... of a parameter θ with gradient g:
//
//   m = β₁ m + (1 - β₁) g,  v = β₂ v + (1 - β₂) g²
//   N∞ = 2 / (1 - β₂) - 1,  N = N∞ - 2 t β₂ᵗ / (1 - β₂ᵗ)          (N_sma: length of the average)
//   N ≥ 5:  θ -= rate r / (1 - β₁ᵗ) m / (√v + ε)
//           r = √((1 - β₂ᵗ) (N - 4) (N - 2) N∞ / ((N∞ - 4) (N∞ - 2) N))
//   N < 5:  θ -= rate / (1 - β₁ᵗ) m
//
// Liu et al. say N > 4; the published code is more careful.

namespace eventgan {
namespace {

struct StepFactor {
  double factor;  ///< of the rate
  bool rectified;
};

StepFactor step_factor(std::int64_t step, double beta1, double beta2) {
  const auto t = static_cast<double>(step);
  const double decay = std::pow(beta2, t);
  const double n_max = 2 / (1 - beta2) - 1;
  const double n = n_max - 2 * t * decay / (1 - decay);
  const double bias = 1 - std::pow(beta1, t);
  if (!(n >= 5)) return {1 / bias, false};
  const double rectification =
      std::sqrt((1 - decay) * (n - 4) / (n_max - 4) * (n - 2) / n * n_max / (n_max - 2));
  return {rectification / bias, true};
}

NamedTensor to_named(const at::Tensor& tensor) {
  const at::Tensor plain = tensor.to(at::kCPU, at::kFloat).contiguous();
  const float* first = plain.data_ptr<float>();
  return {plain.sizes().vec(), {first, first + plain.numel()}};
}

const NamedTensor& find_named(const StateDict& state, const std::string& name,
                              const std::vector<std::int64_t>& shape) {
  const auto found = state.find(name);
  if (found == state.end()) {
    throw std::runtime_error("expected " + name + ", got nothing of that name (optimiser's state)");
  }
  std::int64_t count = 1;
  for (const std::int64_t side : shape) count *= side;
  if (found->second.shape != shape ||
      found->second.values.size() != static_cast<std::size_t>(count)) {
    std::ostringstream message;
    message << "expected shape " << at::IntArrayRef(shape) << ", got "
            << at::IntArrayRef(found->second.shape) << " with " << found->second.values.size()
            << " values, in " << name << " (optimiser's state)";
    throw std::runtime_error(message.str());
  }
  return found->second;
}

at::Tensor to_tensor(const NamedTensor& named, const at::Tensor& like) {
  // from_blob takes no const pointer; the copy below only reads.
  auto* values = const_cast<float*>(named.values.data());
  at::Tensor tensor = at::zeros_like(like);
  tensor.copy_(at::from_blob(values, named.shape, at::kFloat));
  return tensor;
}

bool is_decay(double beta) { return beta >= 0 && beta < 1; }

}  // namespace

RAdam::RAdam(std::vector<at::Tensor> parameters, Options options)
    : parameters_(std::move(parameters)), options_(options), steps_(parameters_.size(), 0) {
  if (!(options.rate >= 0) || !is_decay(options.beta1) || !is_decay(options.beta2) ||
      !(options.epsilon >= 0)) {
    std::ostringstream message;
    message << "expected rate and epsilon >= 0 and betas in [0, 1), got rate " << options.rate
            << ", betas " << options.beta1 << " and " << options.beta2 << ", epsilon "
            << options.epsilon << " (RAdam)";
    throw std::invalid_argument(message.str());
  }
  const c10::NoGradGuard no_gradients;
  for (const at::Tensor& parameter : parameters_) {
    first_moments_.push_back(at::zeros_like(parameter));
    second_moments_.push_back(at::zeros_like(parameter));
  }
}

void RAdam::step() {
  const c10::NoGradGuard no_gradients;
  const double beta1 = options_.beta1, beta2 = options_.beta2;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    const at::Tensor& gradient = parameters_[i].grad();
    if (!gradient.defined()) continue;
    at::Tensor& m = first_moments_[i];
    at::Tensor& v = second_moments_[i];
    v.mul_(beta2).addcmul_(gradient, gradient, 1 - beta2);
    m.mul_(beta1).add_(gradient, 1 - beta1);
    const StepFactor factor = step_factor(++steps_[i], beta1, beta2);
    const double rate = -factor.factor * options_.rate;
    if (factor.rectified) {
      parameters_[i].addcdiv_(m, v.sqrt().add_(options_.epsilon), rate);
    } else {
      parameters_[i].add_(m, rate);
    }
  }
}

void RAdam::zero_grad() {
  for (at::Tensor& parameter : parameters_) parameter.mutable_grad().reset();
}

void RAdam::save(StateDict& state, const std::string& prefix) const {
  state[prefix + ".step"] = {{static_cast<std::int64_t>(steps_.size())},
                             {steps_.begin(), steps_.end()}};
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    state[prefix + ".m." + std::to_string(i)] = to_named(first_moments_[i]);
    state[prefix + ".v." + std::to_string(i)] = to_named(second_moments_[i]);
  }
}

void RAdam::load(const StateDict& state, const std::string& prefix) {
  const c10::NoGradGuard no_gradients;
  const NamedTensor& steps =
      find_named(state, prefix + ".step", {static_cast<std::int64_t>(parameters_.size())});
  std::vector<at::Tensor> first, second;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    const auto moment = [&](const std::string& name) {
      const std::string full_name = prefix + name + std::to_string(i);
      return to_tensor(find_named(state, full_name, parameters_[i].sizes().vec()), parameters_[i]);
    };
    first.push_back(moment(".m."));
    second.push_back(moment(".v."));
  }
  steps_.assign(steps.values.begin(), steps.values.end());
  first_moments_ = std::move(first);
  second_moments_ = std::move(second);
}

}  // namespace eventgan
