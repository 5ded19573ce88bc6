#pragma once

#include <torch/nn/module.h>

#include <initializer_list>
#include <vector>

namespace eventgan {

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
