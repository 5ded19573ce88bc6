#pragma once

#include <torch/nn/module.h>

#include <string>

#include "manifests/state_dict.h"

namespace eventgan {

/// Writes all parameters and buffers under prefix + name, as float32.
void save_network(const torch::nn::Module& network, StateDict& state, const std::string& prefix);

/// Reads them back; other entries of `state` are not looked at. Throws std::runtime_error naming
/// what is missing or has another shape, before anything is changed.
void load_network(torch::nn::Module& network, const StateDict& state, const std::string& prefix);

}  // namespace eventgan
