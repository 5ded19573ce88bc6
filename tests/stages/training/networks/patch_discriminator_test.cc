#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/training/networks/initialization_internal.h"
#include "stages/training/networks/network_state_internal.h"
#include "stages/training/networks/patch_discriminator_internal.h"
#include "tests/stages/training/networks/golden_network.h"
#include "tests/stages/training/networks/gradient_check.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

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

TEST(PatchDiscriminator, GivesOneLogitForTheSmallestPicture) {
  PatchDiscriminator network(4, 2, 2);
  initialize(*network, 1);
  const int side = PatchDiscriminatorImpl::smallest_side();
  EXPECT_THAT(
      network->forward(at::zeros({3, 4, side, side}), at::zeros({3, 2, side, side})).sizes().vec(),
      ::testing::ElementsAre(3, 1, 1, 1));
  EXPECT_THROW(
      network->forward(at::zeros({3, 4, side - 1, side}), at::zeros({3, 2, side - 1, side})),
      c10::Error);
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
