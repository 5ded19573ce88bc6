#include "stages/generator/onednn/onednn_generator.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/generator/onednn/onednn_support.h"
#include "stages/generator/untrained.h"

namespace eventgan {
namespace {

TEST(OnednnGenerator, SaysWhatChangesItsBytes) {
  const auto text =
      make_onednn_generator(untrained_weights(1, 1, 1), Precision::kFloat32)->description();
  EXPECT_TRUE(text.starts_with("onednn float32, 1 thread, oneDNN ")) << text;
  EXPECT_NE(text.find(onednn_support(Precision::kFloat32).instruction_set), std::string::npos)
      << text;
}

TEST(OnednnGenerator, RefusesInt8WithoutCalibration) {
  if (!onednn_support(Precision::kInt8).able) GTEST_SKIP() << "no int8 here";
  EXPECT_THROW(make_onednn_generator(untrained_weights(2, 9, 1), Precision::kInt8),
               std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
