#pragma once

#include <torch/nn/module.h>

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "manifests/values/weights.h"
#include "stages/training/networks/detail/patch_discriminator.h"
#include "stages/training/networks/detail/unet.h"

namespace eventgan {

// Starting values, distributed as the published code draws them, but from CounterRandom keyed by
// the parameter's name: one seed gives one network, on every machine. Each sets all parameters and
// buffers.

/// Convolutions: Kaiming normal of slope 10, that is N(0, 2 / (101 fan_in)), bias 0. Batch norm:
/// scale 1, shift 0. Spectral-normalised convolutions: weight_bar uniform in ±1/√fan_in (LibTorch's
/// default; the published initialisation does not reach them), u and v random unit vectors.
void initialize(UNetImpl& network, std::uint64_t seed);

/// Weights and biases uniform in ±1/√fan_in (LibTorch's default, which the published code leaves).
void initialize(PatchDiscriminatorImpl& network, std::uint64_t seed);

/// Writes all parameters and buffers under prefix + name, as float32.
void save_network(const torch::nn::Module& network, StateDict& state, const std::string& prefix);

/// Reads them back; other entries of `state` are not looked at. Throws std::runtime_error naming
/// what is missing or has another shape, before anything is changed.
void load_network(torch::nn::Module& network, const StateDict& state, const std::string& prefix);

/// Holds a copy of networks' buffers (batch norm's statistics, spectral norm's vectors), which
/// every forward pass moves, and puts it back at its end unless told to keep what is there then.
class BufferSnapshot {
 public:
  explicit BufferSnapshot(std::initializer_list<torch::nn::Module*> networks);
  ~BufferSnapshot();
  BufferSnapshot(const BufferSnapshot&) = delete;
  BufferSnapshot& operator=(const BufferSnapshot&) = delete;

  void keep_current() { copies_.clear(); }

 private:
  std::vector<at::Tensor> buffers_;
  std::vector<at::Tensor> copies_;
};

}  // namespace eventgan
