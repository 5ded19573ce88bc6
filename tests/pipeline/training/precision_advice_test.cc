#include "pipeline/training/precision_advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::HasSubstr;

constexpr char kWithout[] = "x86-64 avx2 fma avx512f avx512vnni";
constexpr char kWith[] = "x86-64 avx2 fma avx512f avx512vnni avx512bf16";

TEST(PrecisionAdvice, WarnsOfBfloat16WithoutInstructionsForIt) {
  EXPECT_THAT(precision_advice(TrainingPrecision::kBfloat16, "cpu", kWithout), HasSubstr(kWithout));
}

TEST(PrecisionAdvice, IsSilentElsewhere) {
  EXPECT_EQ(precision_advice(TrainingPrecision::kBfloat16, "cpu", kWith), "");
  EXPECT_EQ(precision_advice(TrainingPrecision::kBfloat16, "cuda", kWithout), "");
  EXPECT_EQ(precision_advice(TrainingPrecision::kFloat32, "cpu", kWithout), "");
}

}  // namespace
}  // namespace eventgan
