#include "stages/generator/torch/fit_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "manifests/counter_random.h"
#include "stages/generator/calibration/quantized_tensors.h"

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

/// Sums of one pair in which every tensor holds what `value` says.
template <class Value>
CalibrationSums sums_of(int base_channels, int pixels, const Value& value) {
  CalibrationSums sums = empty_calibration_sums(base_channels);
  sums.pairs = 1;
  for (TensorSums& tensor : sums.tensors) {
    const int channels = int(tensor.highest.size());
    std::vector<float> values;
    for (int i = 0; i < pixels * channels; ++i) {
      values.push_back(float(value(i / channels, i % channels)));
    }
    add_tensor(tensor, values);
  }
  return sums;
}

TEST(FitCalibration, GuessesTheLostPartOfOneChannelFromTheOther) {
  // Channel 0 is kept, and channel 1 is -0.01 of it minus 0.03: the guess is that, but for the
  // ridge.
  const CounterRandom random(3);
  const auto value = [&](int pixel, int channel) {
    const double kept = random.uniform(pixel) * 8;
    return channel % 2 == 0 ? kept : -0.01 * kept - 0.03;
  };
  const Calibration calibration = fit_calibration(sums_of(2, 4000, value), "ORIGIN");
  EXPECT_EQ(calibration.pairs, 1);
  EXPECT_EQ(calibration.origin, "ORIGIN");
  const TensorStatistics& head = calibration.tensors.front();
  EXPECT_THAT(head.highest, ElementsAre(::testing::FloatNear(8, 0.1f), 0));
  EXPECT_THAT(head.mean, ElementsAre(::testing::FloatNear(4, 0.1f), 0));
  // One varying channel of two: its ridge is 0.1 of its variance and 0.001 of half of it.
  const double slope = -0.01 / (1 + 0.1 + 0.0005);
  EXPECT_THAT(head.mixing, ElementsAre(::testing::FloatNear(0, 1e-7f), 0,
                                       ::testing::FloatNear(float(slope), 1e-7f), 0));
  EXPECT_NEAR(head.offset[0], 0, 1e-6);
  EXPECT_NEAR(head.offset[1], -0.01 * head.mean[0] - 0.03 - slope * head.mean[0], 1e-6);
}

TEST(FitCalibration, ConstantTensorsHaveAnOffsetAlone) {
  const auto value = [](int, int channel) { return channel == 0 ? 3.7 : -0.01 * channel; };
  const Calibration calibration = fit_calibration(sums_of(2, 1000, value), "");
  for (const TensorStatistics& tensor : calibration.tensors) {
    EXPECT_THAT(tensor.mixing, Each(0.0f)) << tensor.name;
    for (std::size_t c = 1; c < tensor.offset.size(); ++c) {
      EXPECT_NEAR(tensor.offset[c], -0.01 * double(c), 1e-6) << tensor.name;
    }
  }
}

TEST(FitCalibration, TensorsOfZerosOrOfOnePixelAreHarmless) {
  for (const double constant : {0.0, 2.0, -2.0}) {
    const auto sums = sums_of(1, 1, [&](int, int) { return constant; });
    EXPECT_NO_THROW(fit_calibration(sums, ""));
  }
}

TEST(FitCalibration, IsTheSameEachTime) {
  const CounterRandom random(9);
  const auto sums = sums_of(
      2, 50, [&](int pixel, int channel) { return random.uniform(pixel * 64 + channel) - 0.4; });
  const Calibration one = fit_calibration(sums, ""), other = fit_calibration(sums, "");
  for (std::size_t i = 0; i < one.tensors.size(); ++i) {
    EXPECT_EQ(one.tensors[i].mixing, other.tensors[i].mixing);
    EXPECT_EQ(one.tensors[i].offset, other.tensors[i].offset);
  }
}

TEST(FitCalibration, NeedsAPair) {
  EXPECT_THROW(fit_calibration({}, ""), std::invalid_argument);
  EXPECT_THROW(fit_calibration(empty_calibration_sums(1), ""), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
