#include "stages/generator/checkpoints/fold.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "stages/generator/weights.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// A state dict of the published names whose folding is easy to compute by hand: weights all
/// `weight`, batch norm with γ = 2, β = 3, mean = 5, variance = 4 - 1e-5 (so that √(variance + ε) =
/// 2).
StateDict plain_state(int base, float weight, int inputs = 2) {
  StateDict state;
  for (const Convolution& layer : network_layout(base, 9, inputs)) {
    const bool ends = layer.name == "head" || layer.name == "pred";
    const bool residual = layer.name.starts_with("resblocks");
    const std::string module = residual ? layer.name : layer.name + ".conv2d";
    const std::size_t count =
        std::size_t(layer.out_channels) * layer.in_channels * layer.kernel * layer.kernel;
    const std::size_t rows = layer.out_channels;
    state[module + ".weight"] = {
        {layer.out_channels, layer.in_channels, layer.kernel, layer.kernel},
        std::vector<float>(count, weight)};
    if (ends) {
      state[module + ".bias"] = {{layer.out_channels}, std::vector<float>(rows, 0.5f)};
      continue;
    }
    std::string norm = layer.name + ".norm_layer";
    if (residual) (norm = layer.name).replace(norm.rfind("conv"), 4, "bn");
    const auto set = [&](const char* key, float value) {
      state[norm + key] = {{layer.out_channels}, std::vector<float>(rows, value)};
    };
    set(".weight", 2), set(".bias", 3), set(".running_mean", 5), set(".running_var", 4 - 1e-5f);
  }
  return state;
}

const Convolution& layer(const Weights& weights, const std::string& name) {
  for (const Convolution& convolution : weights.convolutions) {
    if (convolution.name == name) return convolution;
  }
  throw std::logic_error(name);
}

TEST(FoldGenerator, FoldsBatchNormIntoWeightAndBias) {
  const Weights weights = fold_generator(plain_state(2, 0.25f), "test");
  EXPECT_EQ(weights.base_channels, 2);
  EXPECT_EQ(weights.bins, 9);
  // factor = γ/√(var + ε) = 1: weight unchanged, bias = 3 - 5 x 1 = -2.
  EXPECT_THAT(layer(weights, "encoders.1").weight,
              ::testing::Each(::testing::FloatNear(0.25f, 1e-6f)));
  EXPECT_THAT(layer(weights, "resblocks.1.conv2").bias,
              ::testing::Each(::testing::FloatNear(-2, 1e-5f)));
  EXPECT_THAT(layer(weights, "head").bias, ::testing::Each(0.5f));
}

TEST(FoldGenerator, DividesBySpectralNormAfterOnePowerIteration) {
  StateDict state = plain_state(1, 1.0f);
  const std::string module = "decoders.3.conv2d";  // [1, 3, 3, 3]: a row of 27 ones
  state[module + ".module.weight_bar"] = state.at(module + ".weight");
  state[module + ".module.weight_u"] = {{1}, {0.5f}};
  state[module + ".module.weight_v"] = {{27}, std::vector<float>(27, 1.0f)};
  state.erase(module + ".weight");
  // v = 1/√27 each, W v = √27, u = 1, σ = √27: the stored v plays no part.
  EXPECT_THAT(layer(fold_generator(state, "test"), "decoders.3").weight,
              ::testing::Each(::testing::FloatNear(float(1 / std::sqrt(27.0)), 1e-6f)));
  // The bias lies beside the weight, and is not divided: 3 + (0.5 - 5) x 1.
  state[module + ".module.bias"] = {{1}, {0.5f}};
  EXPECT_THAT(layer(fold_generator(state, "test"), "decoders.3").bias,
              ::testing::ElementsAre(::testing::FloatNear(-1.5f, 1e-5f)));
}

/// The network that was folded elsewhere: convolutions with a bias, no batch norm.
StateDict folded_state(bool published_names) {
  StateDict state;
  for (const Convolution& layer : untrained_weights(2, 9, 5).convolutions) {
    const bool bare = !published_names || layer.name.starts_with("resblocks");
    const std::string key = layer.name + (bare ? "" : ".conv2d");
    state[key + ".weight"] = {{layer.out_channels, layer.in_channels, layer.kernel, layer.kernel},
                              layer.weight};
    state[key + ".bias"] = {{layer.out_channels}, std::vector<float>(layer.out_channels, 0.25f)};
  }
  return state;
}

TEST(FoldGenerator, TakesAFoldedNetworkAsItIs) {
  const Weights expected = untrained_weights(2, 9, 5);
  for (const bool published_names : {true, false}) {
    const Weights weights = fold_generator(folded_state(published_names), "test");
    for (std::size_t i = 0; i < expected.convolutions.size(); ++i) {
      EXPECT_EQ(weights.convolutions[i].weight, expected.convolutions[i].weight);
      EXPECT_THAT(weights.convolutions[i].bias, ::testing::Each(0.25f));
    }
  }
}

TEST(FoldGenerator, AConvolutionsOwnBiasGoesThroughBatchNorm) {
  StateDict state = plain_state(1, 1.0f);
  state["encoders.0.conv2d.bias"] = {{2}, {1, 2}};
  state["encoders.0.norm_layer.weight"].values = {4, 2};
  // factor = γ/2 = 2, 1; bias = 3 + (own - 5) factor.
  EXPECT_THAT(layer(fold_generator(state, "test"), "encoders.0").bias,
              ::testing::Pointwise(::testing::FloatNear(1e-5f), {-5.0f, 0.0f}));
}

TEST(FoldGenerator, RefusesALayerWithNeitherBatchNormNorBias) {
  StateDict state = folded_state(true);
  state.erase("decoders.1.conv2d.bias");
  EXPECT_THROWS(fold_generator(state, "test"), std::runtime_error,
                "decoders.1.norm_layer.weight or decoders.1.conv2d.bias");
}

TEST(FoldGenerator, RefusesWhatBelongsToNoLayer) {
  StateDict state = plain_state(1, 1.0f);
  state["encoders.0.norm_layer.num_batches_tracked"] = {{}, {7}};  // counts, and plays no part
  EXPECT_NO_THROW(fold_generator(state, "test"));
  for (const char* key :
       {"resblocks.2.conv1.weight", "encoders.4.conv2d.weight", "attention.weight",
        "encoders.1.conv2d.weight_v", "pred.norm_layer.running_mean"}) {
    StateDict larger = state;
    larger[key] = {{1}, {1}};
    EXPECT_THROWS(
        fold_generator(larger, "FILE"), std::runtime_error,
        "expected no other tensors than the generator's, got " + std::string(key) + ", in FILE")
        << key;
  }
}

TEST(FoldGenerator, OfANetworkThatKnowsItsSensorHasThreeInputs) {
  const Weights weights =
      fold_generator(plain_state(2, 0.25f, 3), "test", ThresholdRange{0.1, 0.4});
  EXPECT_EQ(weights.thresholds, (ThresholdRange{0.1, 0.4}));
  EXPECT_EQ(layer(weights, "head").in_channels, 3);
  EXPECT_THAT(layer(weights, "head").weight, ::testing::Each(0.25f));
  EXPECT_EQ(layer(weights, "head").weight.size(), 2u * 3 * 9);
  EXPECT_THROWS(fold_generator(plain_state(2, 0.25f), "FILE", ThresholdRange{0.1, 0.4}),
                std::runtime_error, "expected a generator of 3 inputs to 2 x bins channels");
  EXPECT_THROWS(fold_generator(plain_state(2, 0.25f, 3), "FILE"), std::runtime_error,
                "expected a generator of 2 inputs to 2 x bins channels");
}

TEST(FoldGenerator, NamesWhatIsMissing) {
  StateDict state = plain_state(1, 1.0f);
  state.erase("encoders.2.norm_layer.running_var");
  try {
    fold_generator(state, "FILE");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(),
                ::testing::AllOf(::testing::HasSubstr("encoders.2.norm_layer.running_var"),
                                 ::testing::HasSubstr("FILE")));
  }
}

TEST(FoldGenerator, RefusesAnotherShapeAndNumbersThatAreNotFinite) {
  StateDict wrong = plain_state(1, 1.0f);
  wrong["encoders.0.conv2d.weight"].values.pop_back();
  EXPECT_THROWS(fold_generator(wrong, "test"), std::runtime_error,
                "expected 18 values of encoders.0.conv2d.weight, got 17");
  wrong = plain_state(1, 1.0f);
  std::swap(wrong["encoders.0.conv2d.weight"].shape[0], wrong["encoders.0.conv2d.weight"].shape[1]);
  EXPECT_THROWS(fold_generator(wrong, "test"), std::runtime_error,
                "expected shape [2, 1, 3, 3] of encoders.0.conv2d.weight");
  EXPECT_THROWS(fold_generator(plain_state(1, NAN), "test"), std::runtime_error,
                "expected finite numbers, got NaN or infinity in head");
  EXPECT_THROWS(fold_generator({}, "test"), std::runtime_error,
                "expected key head.conv2d.weight, got none, in test");
}

}  // namespace
}  // namespace eventgan
