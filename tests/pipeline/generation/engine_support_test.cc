#include "pipeline/generation/engine_support.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(EngineSupport, LibtorchAlwaysHasFloat32AndNeverInt8) {
  EXPECT_TRUE(engine_support(Precision::kFloat32).torch_able);
  EXPECT_FALSE(engine_support(Precision::kInt8).torch_able);
}

TEST(EngineSupport, IsOfOnePieceForEveryPrecision) {
  for (const Precision precision : {Precision::kFloat32, Precision::kBfloat16, Precision::kInt8}) {
    const EngineSupport support = engine_support(precision);
    EXPECT_NE(support.processor, "");
    EXPECT_TRUE(support.onednn_built || !support.onednn_able);
    EXPECT_EQ(support.processor, engine_support(Precision::kFloat32).processor);
  }
}

}  // namespace
}  // namespace eventgan
