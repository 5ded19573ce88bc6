#include "stages/generator/calibration/calibration_sums.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

TensorSums& head(CalibrationSums& sums) { return sums.tensors.front(); }  // leaky, base channels

TEST(CalibrationSums, AddUpKeptAndLostParts) {
  CalibrationSums sums = empty_calibration_sums(2);
  add_tensor(head(sums), std::vector<float>{3, -1, 2, 5, -4, 0});  // three pixels of two channels
  EXPECT_EQ(head(sums).pixels, 3);
  EXPECT_THAT(head(sums).highest, ElementsAre(3, 5));
  EXPECT_THAT(head(sums).kept, ElementsAre(5, 5));
  EXPECT_THAT(head(sums).lost, ElementsAre(-4, -1));
  EXPECT_THAT(head(sums).kept_kept, ElementsAre(9 + 4, 10, 10, 25));
  EXPECT_THAT(head(sums).lost_kept, ElementsAre(0, 0, -3, 0));
}

TEST(CalibrationSums, ATensorBehindAReluHasNoPairsOfChannels) {
  CalibrationSums sums = empty_calibration_sums(1);
  TensorSums& block = sums.tensors[6];
  ASSERT_EQ(block.name, "resblocks.0");
  add_tensor(block, std::vector<float>(16, 2.0f));
  EXPECT_THAT(block.kept, Each(2.0));
  EXPECT_TRUE(block.lost.empty() && block.kept_kept.empty() && block.lost_kept.empty());
}

TEST(CalibrationSums, TakeTheHighestOfAllPixelsAndTheSumsOfSome) {
  std::vector<float> values(100'003, 1.0f);
  values[77'777] = 9;
  CalibrationSums sums = empty_calibration_sums(1);
  add_tensor(head(sums), values);
  EXPECT_EQ(head(sums).pixels, 4096);
  EXPECT_THAT(head(sums).highest, ElementsAre(9));
  EXPECT_GE(head(sums).kept[0], 4096);
}

TEST(CalibrationSums, MergingIsAdding) {
  const std::vector<float> first = {1, -2, 3, 4}, second = {-5, 6};
  CalibrationSums together = empty_calibration_sums(2), one = together, other = together;
  add_tensor(head(together), first);
  add_tensor(head(together), second);
  add_tensor(head(one), first);
  add_tensor(head(other), second);
  one.pairs = 1;
  other.pairs = 2;
  merge(one, other);
  EXPECT_EQ(one.pairs, 3);
  EXPECT_EQ(head(one).pixels, head(together).pixels);
  EXPECT_EQ(head(one).highest, head(together).highest);
  EXPECT_EQ(head(one).kept, head(together).kept);
  EXPECT_EQ(head(one).lost, head(together).lost);
  EXPECT_EQ(head(one).kept_kept, head(together).kept_kept);
  EXPECT_EQ(head(one).lost_kept, head(together).lost_kept);
}

TEST(CalibrationSums, RefuseOtherWidthsAndWhatIsNotFinite) {
  CalibrationSums sums = empty_calibration_sums(2);
  EXPECT_THROW(merge(sums, empty_calibration_sums(1)), std::invalid_argument);
  EXPECT_THROW(add_tensor(head(sums), std::vector<float>{1, 2, 3}), std::invalid_argument);
  EXPECT_THROW(add_tensor(head(sums), {}), std::invalid_argument);
  EXPECT_THROW(add_tensor(head(sums), std::vector<float>{1, std::nanf("")}), std::runtime_error);
  EXPECT_THROW(add_tensor(head(sums), std::vector<float>{-INFINITY, 1}), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
