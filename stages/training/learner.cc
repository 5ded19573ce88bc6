#include <ATen/Functions.h>

#include <vector>

#include "stages/training/learner_internal.h"

namespace eventgan {

Learner::Learner(const std::string& name, torch::nn::Module& module, double base_rate,
                 const OptimizerSpec& spec)
    : state_prefix("optimizer." + name),
      network(&module),
      rate(base_rate),
      optimizer(module.parameters(), {base_rate, spec.betas[0], spec.betas[1]}) {}

void set_learning(torch::nn::Module& network, bool learning) {
  network.train(learning);
  for (at::Tensor& parameter : network.parameters()) parameter.set_requires_grad(learning);
}

bool gradients_are_finite(const torch::nn::Module& network) {
  // A sum is not finite if a term is not, and costs one pass.
  std::vector<at::Tensor> sums;
  for (const at::Tensor& parameter : network.parameters()) {
    if (parameter.grad().defined()) sums.push_back(parameter.grad().sum());
  }
  return sums.empty() || at::isfinite(at::stack(sums)).all().item<bool>();
}

}  // namespace eventgan
