#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/values/counter_random.h"
#include "stages/generator/onednn/activation_rows.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/layer_numbers.h"
#include "stages/generator/quantized_network.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

TEST(BlockPool, GivesTheSameBlockAgain) {
  BlockPool pool;
  std::byte* first = nullptr;
  {
    const auto block = pool.take(5000);
    first = block.data();
    std::memset(first, 1, 5000);
  }
  EXPECT_EQ(pool.take(4000).data(), first);
}

TEST(BlockPool, GivesCallsAtTheSameTimeDifferentBlocks) {
  BlockPool pool;
  const auto one = pool.take(1 << 22);
  const auto other = pool.take(1 << 22);
  std::memset(one.data(), 1, 1 << 22);
  std::memset(other.data(), 2, 1 << 22);
  EXPECT_EQ(one.data()[(1 << 22) - 1], std::byte{1});
  EXPECT_EQ(other.data()[0], std::byte{2});
}

TEST(BlockPool, ReplacesABlockThatIsTooSmall) {
  BlockPool pool;
  pool.take(10);
  const auto larger = pool.take(1 << 20);
  std::memset(larger.data(), 3, 1 << 20);
  EXPECT_EQ(larger.data()[(1 << 20) - 1], std::byte{3});
}

Weights calibrated_weights() {
  Weights weights = untrained_weights(2, 3, 7);
  weights.calibration = std::make_shared<const Calibration>(testing::sample_calibration(2, 1));
  return weights;
}

void expect_whole(const NetworkNumbers& numbers) {
  std::vector<std::string> names;
  for (const LayerNumbers& layer : numbers.layers) {
    names.push_back(layer.name);
    EXPECT_EQ(layer.weight.size(),
              std::size_t(layer.out_channels) * layer.in_channels * layer.kernel * layer.kernel)
        << layer.name;
    EXPECT_TRUE(layer.bias.empty() || layer.bias.size() == std::size_t(layer.out_channels))
        << layer.name;
  }
  EXPECT_EQ(names.size(), 10u + 4u * 4u);
  EXPECT_THAT(names,
              ::testing::IsSupersetOf({"head", "pred", "decoders.0.skip", "decoders.1.phases",
                                       "decoders.2.last_row", "decoders.3.last_column"}));
}

TEST(LayerNumbers, AreWhole) {
  expect_whole(float_numbers(untrained_weights(2, 3, 7)));
  expect_whole(int8_numbers(calibrated_weights(), kLargestWeight));
}

TEST(LayerNumbers, OfInt8AreWholeNumbersOfTheWholeRange) {
  for (const int largest : {kLargestWeight, kLargestWeightWithoutVnni}) {
    for (const LayerNumbers& layer : int8_numbers(calibrated_weights(), largest).layers) {
      if (is_float32_layer(layer.name)) {
        EXPECT_TRUE(layer.output_scales.empty()) << layer.name;
        continue;
      }
      float highest = 0;
      for (const float weight : layer.weight) {
        EXPECT_EQ(weight, std::nearbyint(weight)) << layer.name;
        highest = std::max(highest, std::abs(weight));
      }
      EXPECT_EQ(highest, largest) << layer.name;
      EXPECT_EQ(layer.output_scales.size(), std::size_t(layer.out_channels)) << layer.name;
    }
  }
}

TEST(LayerNumbers, OfInt8NeedACalibration) {
  EXPECT_THROWS(int8_numbers(untrained_weights(2, 3, 7), kLargestWeight), std::invalid_argument,
                "expected weights with a calibration for int8, got none");
}

TEST(LayerNumbers, OfInt8ThatLeaveFloat32AreRefusedByTheirLayersName) {
  for (const std::size_t layer : {std::size_t{0}, std::size_t{2}, std::size_t{12}}) {
    Weights weights = calibrated_weights();
    weights.convolutions[layer].bias[0] = std::numeric_limits<float>::max();
    try {
      int8_numbers(weights, kLargestWeight);
      ADD_FAILURE() << weights.convolutions[layer].name;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(weights.convolutions[layer].name));
    }
  }
}

TEST(LayerNumbers, OfInt8ThatCouldMakeInfinitiesOfTwoSignsAreRefused) {
  // 9 taps of two frames of 1 against 2e37 each, in steps of the tensor of at least 1: 3.6e38.
  Weights weights = calibrated_weights();
  Convolution& head = weights.convolutions[0];
  Calibration calibration = *weights.calibration;
  std::ranges::fill(calibration.tensors[0].highest, 255 / 1.1f);
  weights.calibration = std::make_shared<Calibration>(calibration);
  std::ranges::fill(head.weight, 1.8e37f);
  EXPECT_NO_THROW(int8_numbers(weights, kLargestWeight));
  std::ranges::fill(head.weight, 2e37f);
  EXPECT_THROWS(int8_numbers(weights, kLargestWeight), std::invalid_argument,
                "expected finite numbers in steps of the tensors, got others");
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

float value_of(Bfloat16 stored) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(stored.bits) << 16);
}

TEST(StoreActivations, RoundsToTheNearestBfloat16) {
  // Steps of bfloat16 at 1 are 2^-7: halves go to the even neighbour.
  const std::vector<float> values = {1 + 0x1p-8f,  1 + 3 * 0x1p-8f, 1 + 0x1p-8f + 0x1p-20f,
                                     -1 - 0x1p-8f, -0.0f,           kInfinity,
                                     -kInfinity,   3.4e38f,         0x1p-130f};
  const std::vector<float> expected = {1,         1 + 0x1p-6f, 1 + 0x1p-7f, -1,       -0.0f,
                                       kInfinity, -kInfinity,  kInfinity,   0x1p-130f};
  std::vector<Bfloat16> stored(values.size());
  store_activations(values.data(), values.size(), stored.data());
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_EQ(value_of(stored[i]), expected[i]) << values[i];
}

TEST(StoreActivations, KeepsNan) {
  // Also one whose only set bits are dropped.
  const std::vector<float> values = {kNan, std::bit_cast<float>(0x7f800001u),
                                     std::bit_cast<float>(0xffffffffu)};
  std::vector<Bfloat16> halves(values.size());
  std::vector<float> floats(values.size());
  store_activations(values.data(), values.size(), halves.data());
  store_activations(values.data(), values.size(), floats.data());
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_TRUE(std::isnan(value_of(halves[i]))) << i;
    EXPECT_TRUE(std::isnan(floats[i])) << i;
  }
}

TEST(StoreActivations, ClipsAndRoundsToBytes) {
  const std::vector<float> values = {-3,     -0.0f,  0.49f, 0.51f, 1.4f,
                                     254.6f, 255.4f, 256,   1e30f, kInfinity};
  std::vector<std::uint8_t> stored(values.size());
  store_activations(values.data(), values.size(), stored.data());
  EXPECT_THAT(stored, ElementsAre(0, 0, 0, 1, 1, 255, 255, 255, 255, 255));
}

TEST(SaturationCount, CountsTheLargestBytesOfAnyNumber) {
  // All of 70000 bytes, more than bytes can count of any lane, and every third from a start on.
  SaturationCount all;
  all.add(std::vector<std::uint8_t>(70000, 255).data(), 70000);
  EXPECT_EQ(all.saturated, 70000u);
  EXPECT_EQ(all.share(), 1.0);
  std::vector<std::uint8_t> some(1000, 254);
  for (std::size_t i = 0; i < some.size(); i += 3) some[i] = 255;
  for (const std::size_t count : {0, 1, 3, 63, 64, 65, 999, 1000}) {
    SaturationCount counted;
    counted.add(some.data(), count);
    EXPECT_EQ(counted.saturated, (count + 2) / 3) << count;
    EXPECT_EQ(counted.stored, count);
  }
  EXPECT_EQ(SaturationCount().share(), 0.0);
}

TEST(CombinePhases, TakesEachPixelFromItsPhase) {
  // Width 3, two channels: pixels read phase pixels 0, 1, 1 of row phase 1, so phases 2, 3, 2.
  const int channels = 2;
  std::vector<float> phases(2 * 4 * channels);
  for (std::size_t i = 0; i < phases.size(); ++i) phases[i] = float(i);
  const std::vector<float> sums = {100, 200, 300, 400, -500, 600};
  std::vector<float> skip = sums;
  DecoderRow row{3, channels, 1, 0, skip.data(), phases.data(), nullptr, nullptr};
  std::vector<float> stored(6);
  combine_phases(row, stored.data());
  // Phase pixel 0, phase 2: 4, 5; pixel 1, phase 3: 14, 15; pixel 1, phase 2: 12, 13.
  EXPECT_THAT(stored, ElementsAre(104, 205, 314, 415, -488 * 0.01f, 613));

  const std::vector<float> last = {1, 2};
  row.last_pixel = last.data();
  combine_phases(row, stored.data());
  EXPECT_THAT(stored, ElementsAre(104, 205, 314, 415, -499 * 0.01f, 602));

  const std::vector<float> whole = {1, 1, 1, 1, 1, kNan};
  row.whole_row = whole.data();
  combine_phases(row, stored.data());
  EXPECT_THAT(std::vector<float>(stored.begin(), stored.end() - 1),
              ElementsAre(101, 201, 301, 401, -499 * 0.01f));
  EXPECT_TRUE(std::isnan(stored.back()));
}

TEST(CombinePhases, BeginsAtAnOddColumn) {
  // Pixel 1 reads phase pixel 1, phase 1, and pixel 2 the same one's phase 0.
  const std::vector<float> phases = {10, 20, 30, 40};
  std::vector<float> skip = {1, 2};
  const DecoderRow row{2, 1, 0, 1, skip.data(), phases.data(), nullptr, nullptr};
  std::vector<float> stored(2);
  combine_phases(row, stored.data());
  EXPECT_THAT(stored, ElementsAre(21, 12));
}

TEST(CombinePhases, StoresEveryTypeAlike) {
  const int width = 37, channels = 19;
  const CounterRandom random(5);
  std::vector<float> phases((width / 2 + 1) * 4 * channels), skip(width * channels);
  for (std::size_t i = 0; i < phases.size(); ++i) phases[i] = float(random.uniform(i) * 200 - 50);
  for (std::size_t i = 0; i < skip.size(); ++i)
    skip[i] = float(random.uniform(i + 99999) * 200 - 50);
  const DecoderRow row{width, channels, 0, 0, skip.data(), phases.data(), nullptr, nullptr};
  std::vector<float> floats(skip.size());
  std::vector<Bfloat16> halves(skip.size()), expected_halves(skip.size());
  std::vector<std::uint8_t> bytes(skip.size()), expected_bytes(skip.size());
  combine_phases(row, floats.data());
  const std::vector<float> kept = skip;
  combine_phases(row, halves.data());
  skip = kept;
  combine_phases(row, bytes.data());
  store_activations(floats.data(), floats.size(), expected_halves.data());
  store_activations(floats.data(), floats.size(), expected_bytes.data());
  EXPECT_EQ(bytes, expected_bytes);
  for (std::size_t i = 0; i < halves.size(); ++i)
    EXPECT_EQ(halves[i].bits, expected_halves[i].bits);
}

TEST(RectifyIntoPlanes, TurnsPixelsIntoPlanes) {
  const std::size_t pixels = 131;  // more than two blocks and not a multiple
  const int channels = 3;
  std::vector<float> values(pixels * channels);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = float(i) - 100;
  values[7] = kNan;
  std::vector<float> planes(channels * 200, -7);
  EXPECT_FALSE(rectify_into_planes(values.data(), pixels, channels, planes.data(), 200));
  for (int c = 0; c < channels; ++c) {
    for (std::size_t i = 0; i < 200; ++i) {
      const float got = planes[c * 200 + i];
      if (i >= pixels) {
        EXPECT_EQ(got, -7);
      } else if (i * channels + c == 7) {
        EXPECT_TRUE(std::isnan(got));
      } else {
        EXPECT_EQ(got, std::max(0.0f, float(i * channels + c) - 100));
      }
    }
  }
}

TEST(RectifyIntoPlanes, SaysWhetherAllPixelsAreFinite) {
  const std::size_t pixels = 131;
  const int channels = 3;
  std::vector<float> values(pixels * channels), planes(pixels * channels);
  const auto are_finite = [&] {
    return rectify_into_planes(values.data(), pixels, channels, planes.data(), pixels);
  };
  values[5] = std::numeric_limits<float>::max();
  values[8] = std::numeric_limits<float>::lowest();
  EXPECT_TRUE(are_finite());
  for (const float bad : {kNan, -kNan, kInfinity, -kInfinity}) {
    for (const std::size_t at : {std::size_t{0}, std::size_t{200}, values.size() - 1}) {
      const float before = std::exchange(values[at], bad);
      EXPECT_FALSE(are_finite()) << bad << " " << at;
      values[at] = before;
    }
  }
  EXPECT_TRUE(rectify_into_planes(values.data(), 0, channels, planes.data(), 0));
}

TEST(DecoderStrips, HoldEveryRowOnceWithItsPhases) {
  for (int height = 1; height <= 23; ++height) {
    for (int phase_rows = 1; phase_rows <= 7; ++phase_rows) {
      int next_row = 0;
      for (const DecoderStrip& strip : decoder_strips(height, phase_rows)) {
        EXPECT_EQ(strip.first_row, next_row);
        EXPECT_GE(strip.row_count, 1);
        EXPECT_LE(strip.phase_row_count, phase_rows);
        for (int y = strip.first_row; y < strip.first_row + strip.row_count; ++y) {
          const int phase_row = (y + 1) / 2;
          EXPECT_GE(phase_row, strip.first_phase_row);
          EXPECT_LT(phase_row, strip.first_phase_row + strip.phase_row_count);
        }
        next_row += strip.row_count;
      }
      EXPECT_EQ(next_row, height) << phase_rows;
    }
  }
}

}  // namespace
}  // namespace eventgan
