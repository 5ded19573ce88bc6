#include "stages/generator/torch/torch_generator.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/generator/weights.h"

namespace eventgan {
namespace {

TEST(TorchGenerator, SaysWhatChangesItsBytes) {
  const Weights weights = untrained_weights(1, 1, 1);
  const auto text = make_torch_generator(weights)->description();
  EXPECT_TRUE(text.starts_with("torch float32, 1 thread, LibTorch ")) << text;
  EXPECT_NE(make_torch_generator(weights, Precision::kBfloat16)->description(), text);
}

TEST(TorchGenerator, RefusesInt8AndWeightsThatAreNone) {
  EXPECT_THROW(make_torch_generator(untrained_weights(1, 1, 1), Precision::kInt8),
               std::invalid_argument);
  Weights weights = untrained_weights(1, 1, 1);
  weights.convolutions.pop_back();
  EXPECT_THROW(make_torch_generator(weights), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
