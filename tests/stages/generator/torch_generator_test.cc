#include "stages/generator/torch/torch_generator.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/generator/weights.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(TorchGenerator, SaysWhatChangesItsBytesAndRefusesInt8) {
  Weights weights = untrained_weights(1, 1, 1);
  const auto text = make_torch_generator(weights)->description();
  EXPECT_TRUE(text.starts_with("torch float32, 1 thread, LibTorch ")) << text;
  EXPECT_NE(make_torch_generator(weights, Precision::kBfloat16)->description(), text);
  EXPECT_THROWS(make_torch_generator(untrained_weights(1, 1, 1), Precision::kInt8),
                std::invalid_argument, "expected float32 or bfloat16 for LibTorch, got int8");
  weights = untrained_weights(1, 1, 1);
  weights.convolutions.pop_back();
  EXPECT_THROWS(make_torch_generator(weights), std::runtime_error,
                "expected 14 convolutions, got 13, in the weights");
}

}  // namespace
}  // namespace eventgan
