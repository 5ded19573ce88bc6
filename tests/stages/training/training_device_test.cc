#include <gtest/gtest.h>
#include <torch/cuda.h>

#include "manifests/faults.h"
#include "stages/training/trainer.h"
#include "stages/training/training_device_internal.h"
#include "tests/stages/training/small_training.h"

namespace eventgan {
namespace {

TEST(TrainingDevice, IsWhatLibTorchHas) {
  EXPECT_TRUE(training_device("cpu").is_cpu());
  EXPECT_THROW(training_device("tpu"), UsageError);
  EXPECT_THROW(training_device(""), UsageError);
  if (torch::cuda::is_available()) {
    EXPECT_TRUE(training_device("cuda").is_cuda());
  } else {
    EXPECT_THROW(training_device("cuda"), UsageError);
  }
}

TEST(TrainingDevice, IsCheckedByTheTrainer) {
  EXPECT_THROW(Trainer(testing::small_training(), "tpu"), UsageError);
}

}  // namespace
}  // namespace eventgan
