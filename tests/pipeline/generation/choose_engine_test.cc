#include "pipeline/generation/choose_engine.h"

#include <gtest/gtest.h>

#include "manifests/faults.h"

namespace eventgan {
namespace {

using enum Engine;
using enum Precision;

/// Everything works, and well.
EngineSupport all_of(const std::string& processor = "avx512_core_amx") {
  return {.onednn_built = true,
          .onednn_able = true,
          .torch_able = true,
          .native = true,
          .processor = processor};
}

EngineRequest request(std::optional<Engine> engine, Precision precision, bool calibrated = false) {
  return {engine, precision, calibrated, "w.safetensors"};
}

std::string refusal(const EngineRequest& request, const EngineSupport& support) {
  try {
    choose_engine(request, support);
    return "";
  } catch (const UsageError& error) {
    return error.what();
  }
}

TEST(ChooseEngine, AutoTakesOnednnWhereItIsBuiltAndAble) {
  const EngineChoice choice = choose_engine(request({}, kFloat32), all_of());
  EXPECT_EQ(choice.engine, kOnednn);
  EXPECT_EQ(choice.reason, "auto: the fastest engine for float32 on this processor");
  EXPECT_EQ(choice.warning, "");
}

TEST(ChooseEngine, AutoTakesLibtorchElseAndSaysWhy) {
  EngineSupport support = all_of("sse41");
  support.onednn_able = false;
  EngineChoice choice = choose_engine(request({}, kFloat32), support);
  EXPECT_EQ(choice.engine, kTorch);
  EXPECT_EQ(choice.reason,
            "auto: oneDNN has no compiled kernels for float32 on this processor (sse41)");
  support.onednn_built = false;
  choice = choose_engine(request({}, kFloat32), support);
  EXPECT_EQ(choice.engine, kTorch);
  EXPECT_EQ(choice.reason, "auto: this program was built without oneDNN");
}

TEST(ChooseEngine, AnAskedOneIsTakenWithoutComment) {
  for (const Engine engine : {kTorch, kOnednn}) {
    for (const Precision precision : {kFloat32, kBfloat16}) {
      const EngineChoice choice = choose_engine(request(engine, precision), all_of());
      EXPECT_EQ(choice.engine, engine);
      EXPECT_EQ(choice.reason, "as the manifest says");
      EXPECT_EQ(choice.warning, "");
    }
  }
}

TEST(ChooseEngine, AnAskedOneThatIsNotThereIsRefusedWithWhatWouldWork) {
  EngineSupport support = all_of();
  support.onednn_built = support.onednn_able = false;
  EXPECT_EQ(refusal(request(kOnednn, kFloat32), support),
            "$.generator.engine: expected \"auto\" or \"torch\" for float32, got \"onednn\": this "
            "program was built without oneDNN");
}

TEST(ChooseEngine, Int8IsOnednnsAlone) {
  EngineSupport support = all_of();
  support.torch_able = false;
  EXPECT_EQ(choose_engine(request({}, kInt8, true), support).engine, kOnednn);
  EXPECT_EQ(choose_engine(request(kOnednn, kInt8, true), support).engine, kOnednn);
  EXPECT_EQ(refusal(request(kTorch, kInt8, true), support),
            "$.generator.engine: expected \"auto\" or \"onednn\" for int8, got \"torch\": LibTorch "
            "has no int8 for this network");
  support.onednn_built = support.onednn_able = false;
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {kTorch}, {kOnednn}}) {
    EXPECT_EQ(refusal(request(engine, kInt8, true), support),
              "$.generator.precision: expected \"float32\", got \"int8\": this program was built "
              "without oneDNN, and LibTorch has no int8 for this network");
  }
}

TEST(ChooseEngine, Int8NeedsACalibration) {
  EXPECT_EQ(refusal(request({}, kInt8), all_of()),
            "$.generator.weights: expected weights with a calibration for int8, got w.safetensors "
            "without one; run eventgan calibrate MANIFEST");
  EXPECT_EQ(choose_engine(request({}, kFloat32), all_of()).engine, kOnednn);
}

TEST(ChooseEngine, WarnsWhereTheProcessorHasNoInstructionsForThePrecision) {
  EngineSupport support = all_of("avx512_core");
  support.native = false;
  EXPECT_EQ(choose_engine(request({}, kBfloat16), support).warning,
            "precision bfloat16: this processor (avx512_core) has no instructions for it; float32 "
            "is both faster and exact here");
  EXPECT_EQ(choose_engine(request({}, kInt8, true), support).warning,
            "precision int8: this processor (avx512_core) has no instructions for it, so it gains "
            "less than elsewhere; float32 is exact");
  EXPECT_EQ(choose_engine(request({}, kFloat32), support).warning, "");
  EXPECT_NE(choose_engine(request(kTorch, kBfloat16), support).warning, "");
}

TEST(ChooseEngine, RefusesBfloat16WhereNothingComputesItInReasonableTime) {
  EngineSupport support = all_of("avx2");
  support.onednn_able = support.torch_able = support.native = false;
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {kTorch}, {kOnednn}}) {
    EXPECT_EQ(refusal(request(engine, kBfloat16), support),
              "$.generator.precision: expected \"float32\", got \"bfloat16\": oneDNN has no "
              "compiled kernels for bfloat16 on this processor (avx2), and LibTorch has no fast "
              "kernels for bfloat16 on this processor (avx2)");
  }
}

}  // namespace
}  // namespace eventgan
