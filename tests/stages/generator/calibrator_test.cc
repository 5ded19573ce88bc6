#include "stages/generator/onednn/calibrator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>

#include "manifests/values/counter_random.h"
#include "stages/generator/calibration.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/stages/generator/plain_network.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

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

TEST(FitCalibration, TensorsOfOneValueOrOfOnePixelAreHarmless) {
  const auto value = [](int, int channel) { return channel == 0 ? 3.7 : -0.01 * channel; };
  const Calibration calibration = fit_calibration(sums_of(2, 1000, value), "");
  for (const TensorStatistics& tensor : calibration.tensors) {
    EXPECT_THAT(tensor.mixing, Each(0.0f)) << tensor.name;
    for (std::size_t c = 1; c < tensor.offset.size(); ++c) {
      EXPECT_NEAR(tensor.offset[c], -0.01 * double(c), 1e-6) << tensor.name;
    }
  }
  for (const double constant : {0.0, 2.0, -2.0}) {
    const auto sums = sums_of(1, 1, [&](int, int) { return constant; });
    EXPECT_NO_THROW(fit_calibration(sums, ""));
  }
  EXPECT_THROWS(fit_calibration({}, ""), std::invalid_argument,
                "expected sums of at least 1 pair, got none");
  EXPECT_THROWS(fit_calibration(empty_calibration_sums(1), ""), std::invalid_argument,
                "expected sums of at least 1 pair, got none");
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

constexpr ImageSize kCalibratedSize{33, 46};

std::vector<float> frames(std::uint64_t seed) {
  return testing::natural_frames(kCalibratedSize, seed);
}

Calibration calibrate_on(const Weights& weights, std::initializer_list<std::uint64_t> seeds) {
  Calibrator calibrator(weights);
  for (const std::uint64_t seed : seeds) calibrator.add({frames(seed), kCalibratedSize});
  return calibrator.calibration("frames");
}

Weights with_calibration(Weights weights, Calibration calibration) {
  weights.calibration = std::make_shared<const Calibration>(std::move(calibration));
  return weights;
}

/// What the calibrator says is what the plain network holds.
void expect_the_plain_networks(const Weights& weights) {
  std::map<std::string, std::vector<double>> tensors;
  testing::plain_network(
      weights, testing::planes_of(weights, frames(1), kCalibratedSize), kCalibratedSize,
      [&](const std::string& name, const std::vector<double>& values) { tensors[name] = values; });
  const Calibration calibration = calibrate_on(weights, {1});
  EXPECT_EQ(calibration.pairs, 1);
  for (const TensorStatistics& statistics : calibration.tensors) {
    const std::vector<double>& values = tensors.at(statistics.name);
    const std::size_t plane = values.size() / statistics.highest.size();
    for (std::size_t c = 0; c < statistics.highest.size(); ++c) {
      double highest = 0, sum = 0;
      for (std::size_t i = 0; i < plane; ++i) {
        highest = std::max(highest, values[c * plane + i]);
        sum += std::max(values[c * plane + i], 0.0);
      }
      EXPECT_NEAR(statistics.highest[c], highest, 1e-5 * (1 + highest)) << statistics.name;
      EXPECT_NEAR(statistics.mean[c], sum / double(plane), 1e-5 * (1 + highest)) << statistics.name;
    }
  }
}

TEST(Calibrator, SeesWhatNetworksHold) {
  expect_the_plain_networks(untrained_weights(2, 3, 5));
  for (const int base_channels : {2, 8}) {
    expect_the_plain_networks(testing::untrained_sensor_weights(base_channels, 3, 5));
  }
}

TEST(Calibrator, TakesTheThresholdThatAPairTells) {
  const auto calibration = [](const Weights& weights, std::optional<ContrastThreshold> threshold) {
    Calibrator calibrator(weights);
    calibrator.add({frames(1), kCalibratedSize, threshold});
    return calibrator.calibration("frames").tensors.front().highest;
  };
  const Weights weights = testing::untrained_sensor_weights(2, 3, 5);
  EXPECT_EQ(calibration(weights, ContrastThreshold{weights.thresholds->geometric_mean()}),
            calibration(weights, std::nullopt));
  EXPECT_NE(calibration(weights, ContrastThreshold{0.1}), calibration(weights, std::nullopt));
  EXPECT_THROWS(calibration(untrained_weights(2, 3, 5), ContrastThreshold{0.1}),
                std::invalid_argument, "expected none for these weights, got a contrast threshold");
}

TEST(Calibrator, TheSamePairsGiveTheSameCalibration) {
  const Weights weights = untrained_weights(2, 3, 5);
  const Calibration one = calibrate_on(weights, {1, 2}), other = calibrate_on(weights, {1, 2});
  EXPECT_EQ(one.pairs, 2);
  for (std::size_t i = 0; i < one.tensors.size(); ++i) {
    EXPECT_EQ(one.tensors[i].highest, other.tensors[i].highest);
    EXPECT_EQ(one.tensors[i].mean, other.tensors[i].mean);
    EXPECT_EQ(one.tensors[i].offset, other.tensors[i].offset);
    EXPECT_EQ(one.tensors[i].mixing, other.tensors[i].mixing);
  }
}

TEST(Calibrator, EightBitsStayNearTheFloatNetworkAndTheGuessHelps) {
  const Weights weights = untrained_weights(4, 9, 5);
  Calibration calibration = calibrate_on(weights, {0, 1, 2});
  const auto reference = testing::plain_network(weights, frames(99), kCalibratedSize);
  const auto error = [&](const Calibration& used) {
    return testing::relative_error(
        testing::plain_int8_network(with_calibration(weights, used), frames(99), kCalibratedSize),
        reference);
  };
  const double with_guess = error(calibration);
  for (TensorStatistics& statistics : calibration.tensors) {
    std::ranges::fill(statistics.offset, 0.0f);
    std::ranges::fill(statistics.mixing, 0.0f);
  }
  EXPECT_LT(with_guess, 0.04);
  EXPECT_LT(with_guess, 0.9 * error(calibration));
}

TEST(Calibrator, EightBitsStayNearThePublishedNetwork) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const auto checkpoint = data / "golden" / "checkpoint_zip.pt";
  const Weights weights = fold_generator(read_checkpoint(checkpoint, "gen"), checkpoint.string());
  const auto input = [&](const std::string& name) {
    return testing::read_array(golden, "generator/" + name + "/input");
  };
  Calibrator calibrator(weights);
  for (const char* name : {"96x64", "346x260"}) {
    const auto pair = input(name);
    calibrator.add({pair.values, {int(pair.shape[1]), int(pair.shape[2])}});
  }
  const Weights with = with_calibration(weights, calibrator.calibration("golden"));
  const auto pair = input("53x75_odd");
  const auto volume =
      testing::plain_int8_network(with, pair.values, {int(pair.shape[1]), int(pair.shape[2])});
  const auto expected = testing::read_array(golden, "generator/53x75_odd/volume").values;
  EXPECT_LT(testing::relative_error(volume, expected), 0.02);
}

TEST(Calibrator, ConstantImagesAndDeadChannelsAreHarmless) {
  Weights weights = untrained_weights(2, 3, 5);
  for (Convolution& layer : weights.convolutions) {
    if (layer.name == "pred") continue;
    // The first channel of every layer is 0, or always negative.
    std::fill_n(layer.weight.begin(), layer.weight.size() / layer.out_channels, 0.0f);
    layer.bias[0] = layer.name.starts_with("encoders") ? -1.0f : 0.0f;
  }
  for (const float grey : {-1.0f, 0.0f, 1.0f}) {
    Calibrator calibrator(weights);
    calibrator.add({std::vector<float>(2 * kCalibratedSize.pixel_count(), grey), kCalibratedSize});
    const Weights with = with_calibration(weights, calibrator.calibration("constant"));
    for (const float value : testing::plain_int8_network(with, frames(1), kCalibratedSize)) {
      ASSERT_TRUE(std::isfinite(value));
    }
  }
}

TEST(Calibrator, TakesImagesOfOnePixel) {
  Calibrator calibrator(untrained_weights(1, 3, 5));
  calibrator.add({std::vector<float>{0.5f, -0.5f}, {1, 1}});
  EXPECT_NO_THROW(calibrator.calibration("one pixel"));
}

TEST(Calibrator, RefusesWhatItCannotUseAndAddsNothingOfIt) {
  Calibrator calibrator(untrained_weights(1, 3, 5));
  EXPECT_THROWS(calibrator.calibration("no pair"), std::invalid_argument,
                "expected sums of at least 1 pair, got none");
  EXPECT_THROWS(calibrator.add({frames(1), {33, 45}}), std::invalid_argument,
                "expected frames [2, H, W] and a volume [6, H, W] of 45x33");
  EXPECT_THROWS(calibrator.add({}), std::invalid_argument,
                "expected frames [2, H, W] and a volume [6, H, W] of 0x0");
  auto broken = frames(1);
  broken[100] = std::nanf("");
  EXPECT_THROWS(calibrator.add({broken, kCalibratedSize}), std::runtime_error,
                "expected finite values of the frames, got NaN or infinity");
  EXPECT_EQ(calibrator.pairs(), 0);
  EXPECT_THROWS(calibrator.calibration("no pair"), std::invalid_argument,
                "expected sums of at least 1 pair, got none");
}

}  // namespace
}  // namespace eventgan
