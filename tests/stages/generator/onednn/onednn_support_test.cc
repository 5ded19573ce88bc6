#include "stages/generator/onednn/onednn_support.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <stdexcept>
#include <string>

#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/untrained.h"

namespace eventgan {
namespace {

constexpr Precision kPrecisions[] = {Precision::kFloat32, Precision::kBfloat16, Precision::kInt8};

TEST(OnednnSupport, IsOfOneProcessorForEveryPrecision) {
  for (const Precision precision : kPrecisions) {
    const OnednnSupport support = onednn_support(precision);
    EXPECT_TRUE(support.built);
    EXPECT_TRUE(support.able || !support.native);
    EXPECT_EQ(support.instruction_set, onednn_support(Precision::kFloat32).instruction_set);
  }
}

TEST(OnednnSupport, ObeysTheLimitOfTheEnvironment) {
  const char* variable = std::getenv("ONEDNN_MAX_CPU_ISA");
  const std::string limit = variable ? variable : "";
  if (limit != "AVX2" && limit != "AVX512_CORE") GTEST_SKIP() << "no limit that is known here";
  EXPECT_FALSE(onednn_support(Precision::kBfloat16).native) << limit;
  EXPECT_FALSE(onednn_support(Precision::kInt8).native) << limit;
  EXPECT_TRUE(limit != "AVX2" || !onednn_support(Precision::kBfloat16).able);
}

TEST(OnednnSupport, APrecisionThatIsNotAbleIsRefusedByName) {
  for (const Precision precision : kPrecisions) {
    const OnednnSupport support = onednn_support(precision);
    if (support.able) continue;
    try {
      make_onednn_generator(untrained_weights(1, 1, 1), precision);
      ADD_FAILURE() << to_string(precision);
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(std::string(error.what()), "expected a processor on which oneDNN computes " +
                                               std::string(to_string(precision)) + ", got " +
                                               support.instruction_set);
    }
  }
}

}  // namespace
}  // namespace eventgan
