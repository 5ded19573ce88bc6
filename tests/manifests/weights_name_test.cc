#include "manifests/weights_name.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(WeightsName, KnowsTheWords) {
  EXPECT_EQ(parse_weights_name("shipped"), (WeightsName{WeightsOrigin::kShipped, "", {}}));
  EXPECT_EQ(parse_weights_name("shipped:16"), (WeightsName{WeightsOrigin::kShipped, "", 16}));
  EXPECT_EQ(parse_weights_name("untrained:1"), (WeightsName{WeightsOrigin::kUntrained, "", 1}));
  EXPECT_EQ(parse_weights_name("untrained:64"), (WeightsName{WeightsOrigin::kUntrained, "", 64}));
}

TEST(WeightsName, TakesTheRestForPaths) {
  for (const char* path : {"w.safetensors", "../a b/w", "shipped.safetensors", "untrained", ":"}) {
    EXPECT_EQ(parse_weights_name(path), (WeightsName{WeightsOrigin::kFile, path, {}})) << path;
  }
}

TEST(WeightsName, RefusesWhatNamesNothing) {
  using namespace std::string_view_literals;
  for (const auto text : {""sv, "a\0b"sv, "shipped:"sv, "shipped:0"sv, "shipped:08"sv,
                          "shipped:8x"sv, "shipped:-8"sv, "shipped:+8"sv, "shipped: 8"sv,
                          "untrained:"sv, "untrained:65"sv, "untrained:99999999999999999999"sv}) {
    EXPECT_EQ(parse_weights_name(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace eventgan
