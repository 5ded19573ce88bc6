#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "stages/training/networks/network_state_internal.h"
#include "stages/training/networks/spectral_norm_conv_internal.h"
#include "tests/stages/training/networks/gradient_check.h"

namespace eventgan {
namespace {

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

TEST(SpectralNormConv, ASecondForwardDoesNotDisturbTheFirstOnesGradient) {
  const auto gradient = [](bool forward_twice) {
    SpectralNormConv convolution = small_convolution({3, 1, 2, 4}, {1, 0});
    const at::Tensor loss = convolution->forward(at::ones({1, 2, 1, 1})).pow(3).sum();
    if (forward_twice) convolution->forward(at::ones({1, 2, 1, 1}));
    loss.backward();
    return numbers(convolution->parameters()[0].grad());
  };
  EXPECT_EQ(gradient(true), gradient(false));
}

TEST(SpectralNormConv, LearnsItsWeightAlone) {
  SpectralNormConv convolution(torch::nn::Conv2dOptions(3, 4, 3));
  ASSERT_EQ(convolution->named_parameters().size(), 1u);
  EXPECT_EQ(convolution->named_parameters()[0].key(), "module.weight_bar");
}

}  // namespace
}  // namespace eventgan
