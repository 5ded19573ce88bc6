#include "stages/training/networks/detail/network_state.h"

#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/full.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/nn/modules/batchnorm.h>

#include <algorithm>
#include <cmath>

#include "stages/training/networks/detail/spectral_norm_conv.h"
#include "tests/stages/training/network_cases.h"

namespace eventgan {
namespace {

using ::testing::Each;

/// 1x1 convolution of two channels to two: its weight is the matrix itself.
SpectralNormConv small_convolution(std::vector<float> matrix, std::vector<float> u) {
  SpectralNormConv convolution(torch::nn::Conv2dOptions(2, 2, 1));
  load_network(*convolution,
               {{"module.weight_bar", {{2, 2, 1, 1}, std::move(matrix)}},
                {"module.weight_u", {{2}, std::move(u)}},
                {"module.weight_v", {{2}, {0, 0}}}},
               "");
  return convolution;
}

std::vector<float> numbers(const at::Tensor& tensor) {
  const at::Tensor plain = tensor.detach().contiguous();
  return {plain.data_ptr<float>(), plain.data_ptr<float>() + plain.numel()};
}

TEST(SpectralNormConv, DividesByTheNormAfterOnePowerIteration) {
  // W = diag(3, 4), u = (0.6, 0.8): Wᵀu = (1.8, 3.2), v = Wᵀu / √13.48; W v = (5.4, 12.8) / √13.48,
  // and σ = |W v| = √(193 / 13.48).
  SpectralNormConv convolution = small_convolution({3, 0, 0, 4}, {0.6f, 0.8f});
  const at::Tensor output = convolution->forward(at::ones({1, 2, 1, 1}));
  const double sigma = std::sqrt(193 / 13.48);
  EXPECT_THAT(numbers(output), ::testing::Pointwise(::testing::FloatNear(1e-6f),
                                                    {float(3 / sigma), float(4 / sigma)}));
  StateDict state;
  save_network(*convolution, state, "");
  EXPECT_THAT(state.at("module.weight_v").values,
              ::testing::Pointwise(::testing::FloatNear(1e-6f),
                                   {float(1.8 / std::sqrt(13.48)), float(3.2 / std::sqrt(13.48))}));
  EXPECT_THAT(state.at("module.weight_u").values,
              ::testing::Pointwise(::testing::FloatNear(1e-6f),
                                   {float(5.4 / std::sqrt(193)), float(12.8 / std::sqrt(193))}));
}

TEST(SpectralNormConv, AMatrixOfZerosHasNoNormAndGivesNan) {
  // 0 / 0: the trainer refuses the loss that comes of it.
  SpectralNormConv convolution = small_convolution({0, 0, 0, 0}, {0.6f, 0.8f});
  const at::Tensor output = convolution->forward(at::ones({1, 2, 1, 1}));
  for (const float value : numbers(output)) EXPECT_TRUE(std::isnan(value));
}

TEST(SpectralNormConv, ComesToTheLargestSingularValueAlsoInEvaluation) {
  SpectralNormConv convolution = small_convolution({3, 0, 0, 4}, {0.6f, 0.8f});
  convolution->eval();
  at::Tensor output;
  for (int i = 0; i < 60; ++i) output = convolution->forward(at::ones({1, 2, 1, 1}));
  EXPECT_THAT(numbers(output), ::testing::Pointwise(::testing::FloatNear(1e-6f), {0.75f, 1.0f}));
}

TEST(SpectralNormConv, GradientReachesTheWeightThroughSigmaToo) {
  // Where u and v no longer move, dσ/dW = u vᵀ exactly, so that central differences may let them.
  SpectralNormConv convolution(torch::nn::Conv2dOptions(3, 4, 3).stride(2).padding(1));
  for (const auto& parameter : convolution->parameters()) {
    const at::NoGradGuard not_a_step;
    parameter.copy_(at::sin(at::arange(parameter.numel(), at::kFloat) * 1.7f).view_as(parameter));
  }
  for (const auto& buffer : convolution->buffers()) buffer.fill_(1);
  convolution->to(at::kDouble);
  at::Tensor input = at::cos(at::arange(3 * 25, at::kDouble)).view({1, 3, 5, 5});
  input.set_requires_grad(true);
  for (int i = 0; i < 300; ++i) convolution->forward(input);
  std::vector<at::Tensor> inputs = convolution->parameters();
  inputs.push_back(input);
  EXPECT_LT(
      testing::gradient_error([&] { return convolution->forward(input).pow(2).sum(); }, inputs),
      1e-6);
}

TEST(SpectralNormConv, LearnsItsWeightAloneWhateverIsComputedMeanwhile) {
  const auto gradient = [](bool forward_twice) {
    SpectralNormConv convolution = small_convolution({3, 1, 2, 4}, {1, 0});
    const at::Tensor loss = convolution->forward(at::ones({1, 2, 1, 1})).pow(3).sum();
    if (forward_twice) convolution->forward(at::ones({1, 2, 1, 1}));
    loss.backward();
    return numbers(convolution->parameters()[0].grad());
  };
  EXPECT_EQ(gradient(true), gradient(false));
  SpectralNormConv convolution(torch::nn::Conv2dOptions(3, 4, 3));
  ASSERT_EQ(convolution->named_parameters().size(), 1u);
  EXPECT_EQ(convolution->named_parameters()[0].key(), "module.weight_bar");
}

template <class Network>
StateDict initialized(Network network, std::uint64_t seed) {
  initialize(*network, seed);
  StateDict state;
  save_network(*network, state, "");
  return state;
}

StateDict generator(std::uint64_t seed) {
  return initialized(UNet(UNetSettings{2, 18, 4, false, SpectralNormPlace::kDecoders}), seed);
}

double deviation(const std::vector<float>& values) {
  double squares = 0;
  for (const float value : values) squares += double(value) * value;
  return std::sqrt(squares / double(values.size()));
}

TEST(Initialize, DrawsConvolutionsAsThePublishedCode) {
  const StateDict state = generator(1);
  // encoders.3: fan_in = 32 · 9, 64 · 288 values: a sample deviation is within 1 % of the true one.
  const double expected = std::sqrt(2.0 / 101 / 288);
  EXPECT_NEAR(deviation(state.at("encoders.3.conv2d.weight").values), expected, 0.02 * expected);
  EXPECT_THAT(state.at("head.conv2d.bias").values, Each(0.0f));
  EXPECT_THAT(state.at("encoders.0.norm_layer.weight").values, Each(1.0f));
  EXPECT_THAT(state.at("encoders.0.norm_layer.bias").values, Each(0.0f));
  EXPECT_THAT(state.at("resblocks.1.bn2.running_mean").values, Each(0.0f));
  EXPECT_THAT(state.at("resblocks.1.bn2.running_var").values, Each(1.0f));
  EXPECT_THAT(state.at("resblocks.1.bn2.num_batches_tracked").values, Each(0.0f));
}

TEST(Initialize, DrawsSpectralNormConvolutionsUniformly) {
  const StateDict state = generator(1);
  const auto& weight = state.at("resblocks.0.conv1.module.weight_bar").values;
  const double limit = 1 / std::sqrt(64.0 * 9);
  EXPECT_LE(*std::max_element(weight.begin(), weight.end()), limit);
  EXPECT_NEAR(deviation(weight), limit / std::sqrt(3.0), 0.02 * limit);
  for (const char* vector : {"weight_u", "weight_v"}) {
    const auto& values = state.at(std::string("decoders.1.conv2d.module.") + vector).values;
    EXPECT_NEAR(deviation(values) * std::sqrt(double(values.size())), 1, 1e-5) << vector;
  }
}

TEST(Initialize, DrawsTheDiscriminatorUniformly) {
  const StateDict state = initialized(PatchDiscriminator(18, 2, 4), 1);
  const double limit = 1 / std::sqrt(32.0 * 16);
  const auto& weight = state.at("disc.model.8.weight").values;
  EXPECT_NEAR(deviation(weight), limit / std::sqrt(3.0), 0.03 * limit);
  for (const float value : state.at("disc.model.8.bias").values) {
    EXPECT_LE(std::abs(value), limit);
    EXPECT_NE(value, 0.0f);
  }
}

TEST(Initialize, IsAFunctionOfSeedAndName) {
  const StateDict first = generator(7), again = generator(7), other = generator(8);
  for (const auto& [key, tensor] : first) EXPECT_EQ(tensor.values, again.at(key).values) << key;
  EXPECT_NE(first.at("head.conv2d.weight").values, other.at("head.conv2d.weight").values);
  EXPECT_NE(first.at("resblocks.0.conv1.module.weight_bar").values,
            first.at("resblocks.0.conv2.module.weight_bar").values);
}

UNet small_network(std::uint64_t seed) {
  UNet network(UNetSettings{2, 4, 1, false, SpectralNormPlace::kDecoders});
  initialize(*network, seed);
  return network;
}

StateDict saved(const UNet& network, const std::string& prefix) {
  StateDict state;
  save_network(*network, state, prefix);
  return state;
}

std::string load_failure(const StateDict& state, UNet network) {
  try {
    load_network(*network, state, "a.");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no failure";
}

TEST(NetworkState, ComesBackAsItWas) {
  const StateDict state = saved(small_network(1), "a.");
  EXPECT_TRUE(state.at("a.head.conv2d.weight").shape == (std::vector<std::int64_t>{1, 2, 3, 3}));
  EXPECT_TRUE(state.at("a.encoders.0.norm_layer.num_batches_tracked").shape.empty());
  UNet other = small_network(2);
  load_network(*other, state, "a.");
  for (const auto& [key, tensor] : saved(other, "a.")) {
    EXPECT_EQ(tensor.values, state.at(key).values) << key;
  }
}

TEST(NetworkState, NamesWhatIsMissingOrOfAnotherShapeAndChangesNothing) {
  StateDict state = saved(small_network(1), "a.");
  state.erase("a.pred.conv2d.bias");
  UNet network = small_network(2);
  EXPECT_THAT(load_failure(state, network), ::testing::HasSubstr("a.pred.conv2d.bias, got none"));
  EXPECT_EQ(saved(network, "").at("head.conv2d.weight").values,
            saved(small_network(2), "").at("head.conv2d.weight").values);
  state = saved(small_network(1), "a.");
  state["a.pred.conv2d.bias"] = {{5}, std::vector<float>(5)};
  EXPECT_THAT(load_failure(state, small_network(2)),
              ::testing::HasSubstr("[4] of a.pred.conv2d.bias, got [5]"));
  state["a.pred.conv2d.bias"] = {{4}, std::vector<float>(3)};
  EXPECT_THAT(load_failure(state, small_network(2)), ::testing::HasSubstr("a.pred.conv2d.bias"));
}

float running_mean(const torch::nn::BatchNorm2d& norm) {
  return norm->running_mean[0].item<float>();
}

TEST(BufferSnapshot, PutsBackWhatAForwardPassMoved) {
  torch::nn::BatchNorm2d norm(1);  // momentum 0.1
  {
    const BufferSnapshot before({norm.get()});
    norm->forward(at::full({2, 1, 3, 3}, 5.0f));
    EXPECT_FLOAT_EQ(running_mean(norm), 0.5f);
  }
  EXPECT_EQ(running_mean(norm), 0);
  EXPECT_EQ(norm->num_batches_tracked.item<int>(), 0);
}

TEST(BufferSnapshot, KeepsItWhenTold) {
  torch::nn::BatchNorm2d norm(1);
  {
    BufferSnapshot before({norm.get()});
    norm->forward(at::full({2, 1, 3, 3}, 5.0f));
    before.keep_current();
  }
  EXPECT_FLOAT_EQ(running_mean(norm), 0.5f);
}

}  // namespace
}  // namespace eventgan
