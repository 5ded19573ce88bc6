#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/training/networks/initialization_internal.h"
#include "stages/training/networks/network_state_internal.h"

namespace eventgan {
namespace {

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

TEST(NetworkState, NamesWhatIsMissingAndChangesNothing) {
  StateDict state = saved(small_network(1), "a.");
  state.erase("a.pred.conv2d.bias");
  UNet network = small_network(2);
  EXPECT_THAT(load_failure(state, network), ::testing::HasSubstr("a.pred.conv2d.bias, got none"));
  EXPECT_EQ(saved(network, "").at("head.conv2d.weight").values,
            saved(small_network(2), "").at("head.conv2d.weight").values);
}

TEST(NetworkState, NamesAnotherShape) {
  StateDict state = saved(small_network(1), "a.");
  state["a.pred.conv2d.bias"] = {{5}, std::vector<float>(5)};
  EXPECT_THAT(load_failure(state, small_network(2)),
              ::testing::HasSubstr("[4] of a.pred.conv2d.bias, got [5]"));
  state["a.pred.conv2d.bias"] = {{4}, std::vector<float>(3)};
  EXPECT_THAT(load_failure(state, small_network(2)), ::testing::HasSubstr("a.pred.conv2d.bias"));
}

}  // namespace
}  // namespace eventgan
