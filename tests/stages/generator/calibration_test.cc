#include "stages/generator/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/texts.h"

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
  EXPECT_THROWS(merge(sums, empty_calibration_sums(1)), std::invalid_argument,
                "expected sums of one base width, got those of two");
  EXPECT_THROWS(add_tensor(head(sums), std::vector<float>{1, 2, 3}), std::invalid_argument,
                "expected 2 channels of head, got 3 values");
  EXPECT_THROWS(add_tensor(head(sums), {}), std::invalid_argument,
                "expected 2 channels of head, got 0 values");
  EXPECT_THROWS(add_tensor(head(sums), std::vector<float>{1, std::nanf("")}), std::runtime_error,
                "expected finite values of head, got NaN or infinity");
  EXPECT_THROWS(add_tensor(head(sums), std::vector<float>{-INFINITY, 1}), std::runtime_error,
                "expected finite values of head, got NaN or infinity");
}

template <class Change>
void expect_refused(const std::string& reason, const Change& change) {
  Calibration calibration = testing::sample_calibration(2, 1);
  change(calibration);
  try {
    check_calibration(calibration, 2, "NAME");
    ADD_FAILURE() << "accepted: " << reason;
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(reason));
    EXPECT_THAT(error.what(), ::testing::EndsWith("in NAME"));
  }
}

TEST(CheckCalibration, TakesAWholeOneAndRefusesTheRest) {
  EXPECT_NO_THROW(check_calibration(testing::sample_calibration(2, 1), 2, "NAME"));
  EXPECT_THROWS(check_calibration(testing::sample_calibration(2, 1), 3, "NAME"), std::runtime_error,
                "expected 3 values for head, got 2, in NAME");
  expect_refused("at least 1 pair, got 0", [](auto& c) { c.pairs = 0; });
  expect_refused("expected 12 calibrated tensors, got 11", [](auto& c) { c.tensors.pop_back(); });
  expect_refused("statistics for head", [](auto& c) { c.tensors[0].name = "tail"; });
  expect_refused("expected 2 values for head, got 1",
                 [](auto& c) { c.tensors[0].mean.pop_back(); });
  expect_refused("expected 0 values for resblocks.0, got 1",
                 [](auto& c) { c.tensors[6].offset.push_back(0); });
  expect_refused("expected 4 values for head", [](auto& c) { c.tensors[0].mixing.clear(); });
  expect_refused("finite", [](auto& c) { c.tensors[3].mixing[5] = std::nanf(""); });
  expect_refused("finite", [](auto& c) { c.tensors[3].highest[1] = INFINITY; });
  expect_refused("negative", [](auto& c) { c.tensors[11].highest[1] = -1; });
  expect_refused("negative", [](auto& c) { c.tensors[5].mean[1] = -1e-9f; });
}

TEST(QuantizedTensors, FillTheInputsOfEveryConvolutionButTheFloatOnes) {
  constexpr int kBase = 3;
  std::map<std::string, std::set<int>> read;  // convolution → its input channels that are stored
  for (const QuantizedTensor& tensor : quantized_tensors(kBase)) {
    for (const TensorUse& use : tensor.uses) {
      for (int c = 0; c < tensor.channels; ++c) {
        EXPECT_TRUE(read[use.convolution].insert(use.first_channel + c).second) << use.convolution;
      }
    }
  }
  for (const Convolution& layer : network_layout(kBase, 9)) {
    const bool reads_float = layer.name == "head" || layer.name == "pred";
    const std::size_t wanted = reads_float ? 0 : layer.in_channels;
    EXPECT_EQ(read[layer.name].size(), wanted) << layer.name;
    if (!reads_float) {
      EXPECT_EQ(*read[layer.name].rbegin(), layer.in_channels - 1) << layer.name;
    }
  }
}

TEST(QuantizedTensors, AreWhatTheirProducersMake) {
  const auto layout = network_layout(2, 9);
  std::set<std::string> names;
  for (const QuantizedTensor& tensor : quantized_tensors(2)) {
    const auto producer = std::ranges::find(layout, tensor.producer, &Convolution::name);
    ASSERT_NE(producer, layout.end()) << tensor.name;
    EXPECT_EQ(producer->out_channels, tensor.channels) << tensor.name;
    EXPECT_EQ(tensor.leaky, !tensor.name.starts_with("resblocks")) << tensor.name;
    EXPECT_TRUE(tensor.addend.empty() || names.contains(tensor.addend)) << tensor.name;
    EXPECT_TRUE(names.insert(tensor.name).second) << tensor.name;
  }
  EXPECT_EQ(names.size(), 12u);
}

}  // namespace
}  // namespace eventgan
