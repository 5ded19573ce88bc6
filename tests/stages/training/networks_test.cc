#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/training/networks/detail/network_state.h"
#include "stages/training/networks/detail/patch_discriminator.h"
#include "stages/training/networks/detail/unet.h"
#include "tests/stages/training/network_cases.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr UNetSettings kGenerator{2, 18, 8, false, SpectralNormPlace::kDecoders};

at::Tensor image(std::vector<std::int64_t> shape) {
  return at::sin(at::arange(c10::multiply_integers(shape), at::kFloat) * 0.7f).view(shape);
}

TEST(UNet, GeneratorEqualsThePublishedOnesFirstForward) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const at::NoGradGuard only_looking;
  for (const std::string name : {"96x64", "53x75_odd", "346x260"}) {
    UNet network(kGenerator);
    load_network(*network, testing::golden_state(golden, "generator"), "");
    network->eval();
    const auto output =
        network->forward(testing::golden_tensor(golden, "generator/" + name + "/input", true));
    ASSERT_EQ(output.size(), 1u);
    const auto expected = testing::golden_tensor(golden, "generator/" + name + "/volume", true);
    EXPECT_LE(testing::relative_difference(output[0], expected), 1e-5) << name;
  }
}

TEST(UNet, CycleNetworksEqualThePublishedOnes) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const at::NoGradGuard only_looking;
  const std::map<std::string, UNetSettings> networks = {{"flow", {18, 2, 8, true}},
                                                        {"recons", {2, 1, 8, true}}};
  for (const auto& [name, settings] : networks) {
    UNet network(settings);
    load_network(*network, testing::golden_state(golden, name), "");
    network->eval();
    const auto outputs = network->forward(testing::golden_tensor(golden, name + "/input"));
    ASSERT_EQ(outputs.size(), 4u);
    for (int scale = 0; scale < 4; ++scale) {
      const auto expected =
          testing::golden_tensor(golden, name + "/output/" + std::to_string(scale));
      EXPECT_LE(testing::relative_difference(outputs[scale], expected), 1e-5) << name << scale;
    }
  }
}

TEST(UNet, HasThePublishedKeysAndShapes) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const std::map<std::string, UNetSettings> networks = {
      {"generator", kGenerator}, {"flow", {18, 2, 8, true}}, {"recons", {2, 1, 8, true}}};
  for (const auto& [name, settings] : networks) {
    StateDict state;
    save_network(*UNet(settings), state, "");
    const StateDict published = testing::golden_state(golden, name);
    ASSERT_EQ(state.size(), published.size()) << name;
    for (const auto& [key, tensor] : published) {
      ASSERT_TRUE(state.contains(key)) << key;
      EXPECT_EQ(state.at(key).shape, tensor.shape) << key;
    }
  }
}

std::vector<std::string> spectral_layers(SpectralNormPlace place) {
  std::vector<std::string> layers;
  for (const auto& item : UNet(UNetSettings{2, 18, 1, false, place})->named_parameters()) {
    const std::string& key = item.key();
    const auto suffix = key.find(".module.weight_bar");
    if (suffix != std::string::npos) layers.push_back(key.substr(0, suffix));
  }
  return layers;
}

TEST(UNet, HasSpectralNormWhereItIsWanted) {
  EXPECT_THAT(spectral_layers(SpectralNormPlace::kNone), ::testing::IsEmpty());
  EXPECT_THAT(spectral_layers(SpectralNormPlace::kEncoders),
              ::testing::UnorderedElementsAre("encoders.0.conv2d", "encoders.1.conv2d",
                                              "encoders.2.conv2d", "encoders.3.conv2d"));
  EXPECT_THAT(
      spectral_layers(SpectralNormPlace::kDecoders),
      ::testing::UnorderedElementsAre("resblocks.0.conv1", "resblocks.0.conv2", "resblocks.1.conv1",
                                      "resblocks.1.conv2", "decoders.0.conv2d", "decoders.1.conv2d",
                                      "decoders.2.conv2d", "decoders.3.conv2d"));
}

TEST(UNet, GivesTheImagesSizeAndItsRoundedUpHalves) {
  for (const bool multi_scale : {false, true}) {
    UNet network(UNetSettings{2, 3, 1, multi_scale, SpectralNormPlace::kNone});
    initialize(*network, 1);
    network->eval();
    const auto outputs = network->forward(image({2, 2, 33, 18}));
    EXPECT_THAT(outputs.back().sizes().vec(), ::testing::ElementsAre(2, 3, 33, 18));
    if (!multi_scale) continue;
    EXPECT_THAT(outputs[0].sizes().vec(), ::testing::ElementsAre(2, 3, 5, 3));
    EXPECT_THAT(outputs[1].sizes().vec(), ::testing::ElementsAre(2, 3, 9, 5));
    EXPECT_THAT(outputs[2].sizes().vec(), ::testing::ElementsAre(2, 3, 17, 9));
  }
}

TEST(UNet, OutputsHaveASlopeBelowZeroOnlyWhileTheyLearn) {
  constexpr double kSlope = 0.25;
  const auto outputs = [&](double slope, bool learns, bool evaluates) {
    const UNetSettings settings{2, 3, 1, false, SpectralNormPlace::kNone};
    UNet network(settings);
    network->set_output_slope(slope);
    initialize(*network, 1);
    network->train(!evaluates);
    const at::AutoGradMode gradients(learns);
    return network->forward(image({2, 2, 32, 32}))[0].detach();
  };
  const at::Tensor plain = outputs(0, true, false);
  const at::Tensor sloped = outputs(kSlope, true, false);
  EXPECT_EQ(plain.min().item<float>(), 0);
  EXPECT_LT(sloped.min().item<float>(), 0);
  EXPECT_TRUE(at::equal(sloped.clamp_min(0), plain));
  EXPECT_TRUE(at::equal(outputs(kSlope, false, false), plain));
  EXPECT_GE(outputs(kSlope, true, true).min().item<float>(), 0);
}

TEST(UNet, TakesASinglePixel) {
  UNet network(UNetSettings{2, 3, 1, false, SpectralNormPlace::kDecoders});
  initialize(*network, 1);
  network->eval();
  EXPECT_THAT(network->forward(image({1, 2, 1, 1}))[0].sizes().vec(),
              ::testing::ElementsAre(1, 3, 1, 1));
}

TEST(UNet, BatchNormMovesAtThePublishedSpeeds) {
  UNet network(UNetSettings{1, 2, 1, false, SpectralNormPlace::kNone});
  initialize(*network, 1);
  StateDict state;
  network->forward(image({2, 1, 32, 32}));
  save_network(*network, state, "");
  // Of a running variance of 1 a step leaves 1 - momentum, and adds momentum · variance, small
  // here: inputs of a layer are shrunk by the initialisation's gain of 0.14.
  for (const float value : state.at("encoders.0.norm_layer.running_var").values) {
    EXPECT_GE(value, 0.99f);
    EXPECT_LT(value, 0.995f);
  }
  for (const float value : state.at("resblocks.0.bn1.running_var").values) {
    EXPECT_GE(value, 0.9f);
    EXPECT_LT(value, 0.95f);
  }
}

TEST(UNet, GradientsAreThoseOfCentralDifferences) {
  for (const bool multi_scale : {false, true}) {
    UNet network(UNetSettings{2, 3, 2, multi_scale, SpectralNormPlace::kNone});
    initialize(*network, 3);
    network->to(at::kDouble);
    const at::Tensor input = image({2, 2, 32, 24}).to(at::kDouble);
    std::vector<at::Tensor> used;
    for (const auto& item : network->named_parameters()) {
      if (!multi_scale || !item.key().starts_with("pred.")) used.push_back(item.value());
    }
    const auto loss = [&] {
      at::Tensor sum = at::zeros({}, at::kDouble);
      for (const at::Tensor& output : network->forward(input)) sum = sum + output.pow(2).sum();
      return sum;
    };
    EXPECT_LT(testing::gradient_error(loss, used), 1e-6) << multi_scale;
  }
}

TEST(PatchDiscriminator, EqualsThePublishedOne) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const at::NoGradGuard only_looking;
  PatchDiscriminator network(18, 2, 16);
  const StateDict published = testing::golden_state(golden, "discriminator");
  load_network(*network, published, "");
  const auto logits = network->forward(testing::golden_tensor(golden, "discriminator/volume"),
                                       testing::golden_tensor(golden, "discriminator/images"));
  const auto expected = testing::golden_tensor(golden, "discriminator/logits");
  EXPECT_LE(testing::relative_difference(logits, expected), 1e-5);
  StateDict own;
  save_network(*network, own, "");
  EXPECT_EQ(own.size(), published.size());
}

TEST(PatchDiscriminator, GivesOneLogitForTheSmallestImage) {
  PatchDiscriminator network(4, 2, 2);
  initialize(*network, 1);
  const int side = PatchDiscriminatorImpl::smallest_side();
  EXPECT_THAT(
      network->forward(at::zeros({3, 4, side, side}), at::zeros({3, 2, side, side})).sizes().vec(),
      ::testing::ElementsAre(3, 1, 1, 1));
  EXPECT_THROWS(
      network->forward(at::zeros({3, 4, side - 1, side}), at::zeros({3, 2, side - 1, side})),
      c10::Error, "Calculated padded input size");
}

TEST(PatchDiscriminator, GradientsAreThoseOfCentralDifferences) {
  PatchDiscriminator network(2, 2, 1);
  initialize(*network, 5);
  network->to(at::kDouble);
  at::Tensor volume = at::sin(at::arange(2 * 2 * 48 * 48, at::kDouble)).view({2, 2, 48, 48});
  volume.set_requires_grad(true);
  std::vector<at::Tensor> inputs = network->parameters();
  inputs.push_back(volume);
  const auto loss = [&] {
    return network->forward(volume, at::ones({2, 2, 48, 48}, at::kDouble)).sum();
  };
  EXPECT_LT(testing::gradient_error(loss, inputs), 1e-6);
}

}  // namespace
}  // namespace eventgan
