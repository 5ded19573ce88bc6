#include "stages/generator/onednn/onednn_generator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stages/generator/onednn/detail/fused_convolution.h"
#include "stages/generator/onednn/detail/network_plan.h"
#include "stages/generator/onednn/detail/onednn_versions.h"
#include "stages/generator/onednn/winograd.h"
#include "stages/generator/quantized_network.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/texts.h"

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

TEST(OnednnSupport, IsOfEveryProcessorThatHasTheInstructions) {
  using Isa = dnnl::cpu_isa;
  EXPECT_EQ(processor_has(Isa::sse41), onednn_support(Precision::kFloat32).able);
  EXPECT_TRUE(processor_has(Isa::avx2, Isa::avx2_vnni));
  EXPECT_TRUE(processor_has(Isa::avx512_core_bf16, Isa::avx512_core_amx));
  EXPECT_FALSE(processor_has(Isa::avx2_vnni, Isa::avx512_core));
  EXPECT_FALSE(processor_has(Isa::avx512_core, Isa::avx2_vnni));
  EXPECT_FALSE(processor_has(Isa::avx512_core_amx, Isa::avx512_core_bf16));
  // One that came after all that are known here.
  const Isa later{static_cast<int>(Isa::avx512_core_amx) | 1 << 20};
  EXPECT_TRUE(processor_has(Isa::avx512_core_amx, later));
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

TEST(OnednnGenerator, SaysWhatChangesItsBytes) {
  const auto text =
      make_onednn_generator(untrained_weights(1, 1, 1), Precision::kFloat32)->description();
  EXPECT_TRUE(text.starts_with("onednn float32, 1 thread, oneDNN ")) << text;
  EXPECT_NE(text.find(onednn_support(Precision::kFloat32).instruction_set), std::string::npos)
      << text;
  EXPECT_EQ(text.find("narrow layers"), std::string::npos) << text;
  const auto narrow =
      make_onednn_generator(untrained_weights(8, 1, 1), Precision::kFloat32)->description();
  const bool winograd = winograd_fits(8, Precision::kFloat32);
  EXPECT_EQ(narrow.find("Winograd layers 1") != std::string::npos, winograd) << narrow;
  EXPECT_EQ(narrow.find("narrow layers 2") != std::string::npos,
            onednn_support(Precision::kBfloat16).able && !winograd)
      << narrow;
}

TEST(OnednnGenerator, RefusesInt8WithoutCalibration) {
  if (!onednn_support(Precision::kInt8).able) GTEST_SKIP() << "no int8 here";
  EXPECT_THROWS(make_onednn_generator(untrained_weights(2, 9, 1), Precision::kInt8),
                std::invalid_argument, "expected weights with a calibration for int8, got none");
}

/// One pixel of an image, so that all weights meet all activations.
std::vector<std::uint8_t> int8_pixel(LayerNumbers numbers, Activation activation, float add_target,
                                     const std::vector<std::uint8_t>& source,
                                     std::vector<std::uint8_t> target) {
  const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  LayerWeights weights(std::move(numbers), dnnl::memory::data_type::s8, engine);
  ConvolutionSetup setup;
  setup.input = {1, 1};
  setup.source_type = setup.target_type = dnnl::memory::data_type::u8;
  setup.activation = activation;
  setup.add_target = add_target;
  const FusedConvolution convolution(setup, weights, engine);
  std::vector<std::byte> scratch(convolution.scratch_bytes() + 1);
  dnnl::stream stream(engine);
  convolution.run(stream, source.data(), target.data(), scratch.data());
  return target;
}

TEST(FusedConvolution, ScalesEachChannelsSumAndBiasBeforeWhatFollows) {
  if (!onednn_support(Precision::kInt8).able) GTEST_SKIP() << "no int8 here";
  // Sums 1 * 3 + 2 * 4 = 11 and -5 * 4 = -20 and 10 * 3 = 30, with biases 5, 4 and -10: 16, -16
  // and 20, times 2, 1 and 0.25: 32, -16 and 5; plus half of what is there: 42, -6 and 20.
  const LayerNumbers numbers{"layer", 3, 2, 1, {1, 2, 0, -5, 10, 0}, {5, 4, -10}, {2, 1, 0.25f}};
  EXPECT_EQ(int8_pixel(numbers, Activation::kRelu, 0.5f, {3, 4}, {20, 20, 30}),
            (std::vector<std::uint8_t>{42, 0, 20}));
  EXPECT_EQ(int8_pixel(numbers, Activation::kNone, 0, {3, 4}, {20, 20, 30}),
            (std::vector<std::uint8_t>{32, 0, 5}));
}

TEST(FusedConvolution, AddsTheLargestProductsExactly) {
  if (!onednn_support(Precision::kInt8).able) GTEST_SKIP() << "no int8 here";
  // Without VNNI two products are added in 16 bits.
  const bool native = onednn_support(Precision::kInt8).native;
  const auto largest = float(native ? kLargestWeight : kLargestWeightWithoutVnni);
  constexpr int kIn = 64, kOut = 32;
  LayerNumbers numbers{"layer", kOut, kIn, 1, {}, {}, {}};
  std::vector<std::uint8_t> expected;
  for (int out = 0; out < kOut; ++out) {
    for (int in = 0; in < kIn; ++in) numbers.weight.push_back(out % 2 ? -largest : largest);
    // Of the sum of all products n remains 100 + n, where n is the channel.
    const float sum = 255 * largest * kIn;
    numbers.bias.push_back(out % 2 ? sum + 100 + float(out) : -sum + 100 + float(out));
    numbers.output_scales.push_back(1);
    expected.push_back(static_cast<std::uint8_t>(100 + out));
  }
  EXPECT_EQ(int8_pixel(numbers, Activation::kNone, 0, std::vector<std::uint8_t>(kIn, 255),
                       std::vector<std::uint8_t>(kOut)),
            expected);
}

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
      // Head, 4 encoders, 4 residual, 4 decoders of two or more, prediction; but of width 8 head,
      // last decoder and prediction are the engine's own, and where Winograd's fit all are.
      const bool winograd = winograd_fits(base_channels, GetParam());
      if (winograd)
        EXPECT_TRUE(names.empty()) << names.front();
      else
        EXPECT_GE(names.size(), base_channels == 8 ? 14u : 18u);
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
  const std::size_t inputs = 2 * kUsual.pixel_count() * sizeof(float);  // those of the caller
  EXPECT_GE(block + inputs, activations);
  EXPECT_LE(block, activations + 40'000'000);  // strips, and what the kernels work with
}

INSTANTIATE_TEST_SUITE_P(All, NetworkPlans,
                         ::testing::Values(Precision::kFloat32, Precision::kBfloat16,
                                           Precision::kInt8),
                         [](const auto& precision) {
                           return std::string(to_string(precision.param));
                         });

TEST(TilesWork, GrowsWithTilesThatLieApartUntilAllIsComputed) {
  TileMask mask{{480, 640}, 16, 0, 0, std::vector<std::uint8_t>(30 * 40)};
  for (const Precision precision : kPrecisions) {
    for (const int width : {8, 16}) {
      std::ranges::fill(mask.wanted, 0);
      EXPECT_EQ(tiles_work(mask, width, precision), 0);
      mask.wanted[10 * 40 + 20] = 1;
      const double one = tiles_work(mask, width, precision);
      EXPECT_GT(one, 1.0 / (30 * 40));
      EXPECT_LT(one, 0.15);
      // Another far away takes about as much; its neighbour shares nearly all on the coarse levels.
      mask.wanted[10 * 40 + 21] = 1;
      const double neighbours = tiles_work(mask, width, precision);
      mask.wanted[10 * 40 + 21] = 0;
      mask.wanted[25 * 40 + 2] = 1;
      const double apart = tiles_work(mask, width, precision);
      EXPECT_GT(apart, neighbours);
      EXPECT_GT(apart, 1.1 * one);
      EXPECT_LT(apart, 2 * one);
      // A quarter of the tiles, scattered: each layer's tiles with their surroundings are nearly
      // all.
      for (int tile = 0; tile < 30 * 40; ++tile) {
        mask.wanted[static_cast<std::size_t>(tile)] = tile / 40 % 2 == 0 && tile % 2 == 0;
      }
      EXPECT_GT(tiles_work(mask, width, precision), 0.5);
      // Six tenths of them are computed as all.
      std::fill_n(mask.wanted.begin(), 18 * 40, std::uint8_t{1});
      EXPECT_EQ(tiles_work(mask, width, precision), 1);
    }
  }
}

using Plan = std::shared_ptr<const NetworkPlan>;

NetworkLayers layers_of(const Weights& weights) {
  return {weights, Precision::kFloat32, dnnl::engine(dnnl::engine::kind::cpu, 0)};
}

TEST(PlanCache, KeepsThePlansOfTheLatestSizes) {
  NetworkLayers layers = layers_of(untrained_weights(1, 1, 1));
  PlanCache cache(layers);
  const Plan first = cache.plan({4, 4});
  for (int width = 5; width < 20; ++width) cache.plan({4, width});  // 16 sizes
  EXPECT_EQ(cache.plan({4, 4}), first);
  cache.plan({4, 20});  // and 5 is the one that was not used for longest
  EXPECT_EQ(cache.plan({4, 4}), first);
  for (int width = 5; width < 21; ++width) cache.plan({4, width});
  EXPECT_NE(cache.plan({4, 4}), first) << "a cache without bounds";
}

TEST(PlanCache, BuildsOnePlanForManyThreads) {
  NetworkLayers layers = layers_of(untrained_weights(2, 9, 1));
  PlanCache cache(layers);
  std::vector<Plan> plans(8);
  std::vector<std::jthread> threads;
  for (Plan& plan : plans) threads.emplace_back([&] { plan = cache.plan({30, 41}); });
  threads.clear();
  for (const Plan& plan : plans) EXPECT_EQ(plan, plans[0]);
}

TEST(PlanCache, TellsEveryCallOfAFailureAndTriesAgain) {
  Weights weights = untrained_weights(1, 1, 1);
  weights.convolutions.pop_back();  // no plan without a last layer
  NetworkLayers layers = layers_of(weights);
  PlanCache cache(layers);
  std::vector<int> failures(4);
  std::vector<std::jthread> threads;
  for (int& count : failures) {
    threads.emplace_back([&] {
      for (int call = 0; call < 3; ++call) {
        try {
          cache.plan({8, 8});
        } catch (const std::out_of_range&) {
          ++count;
        }
      }
    });
  }
  threads.clear();
  EXPECT_EQ(failures, std::vector<int>(4, 3));
}

}  // namespace
}  // namespace eventgan
