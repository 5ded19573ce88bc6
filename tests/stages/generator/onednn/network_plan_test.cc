#include <gtest/gtest.h>

#include <algorithm>

#include "stages/generator/onednn/network_plan_internal.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/untrained.h"
#include "tests/stages/generator/engine_trials.h"

namespace eventgan {
namespace {

class NetworkPlans : public ::testing::TestWithParam<Precision> {
 protected:
  void SetUp() override {
    if (!onednn_support(GetParam()).able) {
      GTEST_SKIP() << "this processor does not compute " << to_string(GetParam());
    }
  }

  Weights weights_of(int base_channels) const {
    const Weights plain = untrained_weights(base_channels, 9, 1);
    return GetParam() == Precision::kInt8 ? testing::calibrated(plain, {16, 16}) : plain;
  }

  const dnnl::engine engine_{dnnl::engine::kind::cpu, 0};
};

TEST_P(NetworkPlans, UseCompiledKernelsOnly) {
  for (const int base_channels : {8, 32}) {
    NetworkLayers layers(weights_of(base_channels), GetParam(), engine_);
    for (const ImageSize size : {ImageSize{260, 861}, ImageSize{53, 75}, ImageSize{1, 1}}) {
      const auto names = NetworkPlan(layers, size).implementations();
      // Head, 4 encoders, 4 residual, 4 decoders of two or more, prediction.
      EXPECT_GE(names.size(), 18u);
      for (const std::string& name : names) {
        EXPECT_EQ(name.find("ref"), std::string::npos) << name << ", width " << base_channels;
        EXPECT_EQ(name.find("gemm"), std::string::npos) << name << ", width " << base_channels;
      }
    }
  }
}

TEST_P(NetworkPlans, NeedLittleMoreThanTheirActivations) {
  constexpr ImageSize kUsual{260, 861};
  NetworkLayers layers(weights_of(32), GetParam(), engine_);
  const std::size_t value_bytes = dnnl::memory::data_type_size(layers.stored_type());
  const std::size_t activations = activation_bytes(kUsual, 32, value_bytes);
  const std::size_t block = NetworkPlan(layers, kUsual).block_bytes();
  EXPECT_GE(block, activations);
  EXPECT_LE(block, activations + 40'000'000);  // strips, and what the kernels work with
}

INSTANTIATE_TEST_SUITE_P(All, NetworkPlans,
                         ::testing::Values(Precision::kFloat32, Precision::kBfloat16,
                                           Precision::kInt8),
                         [](const auto& precision) {
                           return std::string(to_string(precision.param));
                         });

}  // namespace
}  // namespace eventgan
