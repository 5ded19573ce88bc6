#include "stages/generator/weights_files/shipped_weights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "manifests/faults.h"
#include "stages/generator/weights_files/weights_file.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

std::filesystem::path repository_file(int width) {
  return std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "weights" /
         ("eventgan-" + std::to_string(width) + ".safetensors");
}

TEST(ShippedWeights, AreTheRepositorysFilesByteForByte) {
  for (const int width : shipped_widths()) {
    const auto bytes = shipped_weights_bytes(width);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_TRUE(text == testing::read_file(repository_file(width))) << width;
  }
}

TEST(ShippedWeights, AreAllThatTheRepositoryHas) {
  std::size_t files = 0;
  const std::filesystem::path folder = repository_file(1).parent_path();
  if (std::filesystem::is_directory(folder)) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() == ".safetensors") ++files;
    }
  }
  EXPECT_EQ(shipped_widths().size(), files);
  EXPECT_TRUE(std::ranges::is_sorted(shipped_widths()));
}

TEST(ShippedWeights, AreNetworksOfTheirWidth) {
  for (const int width : shipped_widths()) {
    const Weights weights = read_shipped_weights(width);
    EXPECT_EQ(weights.base_channels, width);
    EXPECT_EQ(weights.bins, 9);
    EXPECT_EQ(weights.training_gaps, (GapRange{1, 6}));  // manifests/weights/train-8.json
  }
}

TEST(ShippedWeights, TheDefaultIsTheLargestOfAtMost16) {
  int expected = 0;
  for (const int width : shipped_widths()) {
    if (width <= 16) expected = std::max(expected, width);
  }
  if (expected == 0) {
    EXPECT_THROW(default_shipped_width(), InputError);
  } else {
    EXPECT_EQ(default_shipped_width(), expected);
  }
}

TEST(ShippedWeights, RefusesOtherWidths) {
  EXPECT_THROW(shipped_weights_bytes(7777), InputError);
  EXPECT_THROW(read_shipped_weights(-8), InputError);
}

}  // namespace
}  // namespace eventgan
