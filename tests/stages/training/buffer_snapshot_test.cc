#include <ATen/ops/full.h>
#include <gtest/gtest.h>
#include <torch/nn/modules/batchnorm.h>

#include "stages/training/buffer_snapshot_internal.h"

namespace eventgan {
namespace {

float running_mean(const torch::nn::BatchNorm2d& norm) {
  return norm->running_mean[0].item<float>();
}

TEST(BufferSnapshot, PutsBackWhatAForwardPassMoved) {
  torch::nn::BatchNorm2d norm(1);  // momentum 0.1
  {
    const BufferSnapshot before({norm.get()});
    norm->forward(at::full({2, 1, 3, 3}, 5.0f));
    EXPECT_FLOAT_EQ(running_mean(norm), 0.5f);
  }
  EXPECT_EQ(running_mean(norm), 0);
  EXPECT_EQ(norm->num_batches_tracked.item<int>(), 0);
}

TEST(BufferSnapshot, KeepsItWhenTold) {
  torch::nn::BatchNorm2d norm(1);
  {
    BufferSnapshot before({norm.get()});
    norm->forward(at::full({2, 1, 3, 3}, 5.0f));
    before.keep_current();
  }
  EXPECT_FLOAT_EQ(running_mean(norm), 0.5f);
}

}  // namespace
}  // namespace eventgan
