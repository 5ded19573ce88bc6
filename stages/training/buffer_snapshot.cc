#include <ATen/core/grad_mode.h>

#include "stages/training/buffer_snapshot_internal.h"

namespace eventgan {

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
