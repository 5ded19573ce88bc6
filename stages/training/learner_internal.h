#pragma once

#include <torch/nn/module.h>

#include <string>

#include "manifests/training_manifest.h"
#include "stages/training/optimizer/radam.h"

namespace eventgan {

/// A network and what changes it.
struct Learner {
  Learner(const std::string& name, torch::nn::Module& module, double base_rate,
          const OptimizerSpec& spec);

  std::string state_prefix;  ///< of the optimiser's state: "optimizer.NAME"
  torch::nn::Module* network;
  double rate;  ///< at the start of its phase
  RAdam optimizer;
};

/// Batch norm's mode, and whether gradients are computed.
void set_learning(torch::nn::Module& network, bool learning);

/// Of all parameters that have a gradient. A finite one whose sum is beyond float32 counts as not
/// finite.
bool gradients_are_finite(const torch::nn::Module& network);

}  // namespace eventgan
