#include "stages/events/noise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;

constexpr VolumeShape kCameraShape{9, {60, 101}};
constexpr double kCameraPixels = 60 * 101;

/// Noise alone; `pair` and `camera` are seeds.
std::vector<float> noise(const NoiseSpec& spec, double duration_s, int pair = 1, int camera = 2,
                         const VolumeShape& shape = kCameraShape) {
  std::vector<float> volume(shape.value_count());
  const double events = add_noise(spec, duration_s, shape,
                                  {CounterRandom(static_cast<std::uint64_t>(camera)),
                                   CounterRandom(static_cast<std::uint64_t>(pair))},
                                  volume);
  EXPECT_NEAR(std::accumulate(volume.begin(), volume.end(), 0.0), events, 1e-6 * events);
  return volume;
}

double sum(const std::vector<float>& volume, int first_channel, int channels) {
  const auto plane = static_cast<std::ptrdiff_t>(kCameraPixels);
  return std::accumulate(volume.begin() + first_channel * plane,
                         volume.begin() + (first_channel + channels) * plane, 0.0);
}

/// Five standard deviations of a Poisson count.
double five_deviations(double mean) { return 5 * std::sqrt(mean); }

/// Which pixels have an event, of either polarity.
std::vector<bool> struck(const std::vector<float>& volume) {
  std::vector<bool> pixels(static_cast<std::size_t>(kCameraPixels));
  for (std::size_t i = 0; i < volume.size(); ++i) {
    if (volume[i] > 0) pixels[i % pixels.size()] = true;
  }
  return pixels;
}

constexpr NoiseSpec kShotAndLeak{.shot_hz = {2, 2}, .leak_hz = {0.5, 0.5}};

TEST(Noise, IsAPoissonNumberOfEventsByPolarity) {
  // A pair's positive events: (2/2 + 0.5) x 0.2 s x 6060 pixels = 1818; negative 1 x 0.2 x 6060.
  constexpr int kPairs = 100;
  const double expected[2] = {1.5 * 0.2 * kCameraPixels, 1 * 0.2 * kCameraPixels};
  double sums[2] = {}, squares[2] = {};
  for (int pair = 0; pair < kPairs; ++pair) {
    const std::vector<float> volume = noise(kShotAndLeak, 0.2, pair);
    for (int polarity = 0; polarity < 2; ++polarity) {
      const double off = sum(volume, 9 * polarity, 9) - expected[polarity];
      sums[polarity] += off;
      squares[polarity] += off * off;
    }
  }
  for (int polarity = 0; polarity < 2; ++polarity) {
    const double mean = expected[polarity];
    EXPECT_NEAR(sums[polarity] / kPairs, 0, five_deviations(mean / kPairs));
    EXPECT_NEAR(squares[polarity] / kPairs, mean, 5 * std::sqrt((mean + 2 * mean * mean) / kPairs));
  }
}

TEST(Noise, EndBinsHaveHalfOfAMiddleOnesShare) {
  const std::vector<float> volume = noise(kShotAndLeak, 20);
  for (int channel = 0; channel < 18; ++channel) {
    const double rate_hz = channel < 9 ? 1.5 : 1;
    const double share = channel % 9 == 0 || channel % 9 == 8 ? 1.0 / 16 : 1.0 / 8;
    const double expected = rate_hz * 20 * kCameraPixels * share;
    EXPECT_NEAR(sum(volume, channel, 1), expected, five_deviations(expected)) << channel;
  }
}

TEST(Noise, IsPoissonInEveryVoxelFewOrMany) {
  // Of a middle bin's voxel: 1/8 of the positive events; the second is drawn voxel by voxel.
  for (const double mean : {2.0, 30.0}) {
    const std::vector<float> volume = noise({.leak_hz = {80, 80}}, mean / 10);
    double off = 0, squares = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(kCameraPixels); ++i) {
      const double value = volume[4 * static_cast<std::size_t>(kCameraPixels) + i];
      ASSERT_EQ(value, std::floor(value));
      off += value - mean;
      squares += (value - mean) * (value - mean);
    }
    EXPECT_NEAR(off / kCameraPixels, 0, five_deviations(mean / kCameraPixels));
    EXPECT_NEAR(squares / kCameraPixels, mean,
                5 * std::sqrt((mean + 2 * mean * mean) / kCameraPixels));
    EXPECT_EQ(sum(volume, 9, 9), 0) << "a leak is positive";
  }
}

TEST(Noise, IsAddedToWhatIsThereAndFollowsFromThePair) {
  const std::vector<float> alone = noise(kShotAndLeak, 1);
  std::vector<float> volume(kCameraShape.value_count(), 0.25f);
  add_noise(kShotAndLeak, 1, kCameraShape, {CounterRandom(2), CounterRandom(1)}, volume);
  for (std::size_t i = 0; i < volume.size(); ++i) ASSERT_EQ(volume[i], alone[i] + 0.25f);
  EXPECT_THAT(noise({}, 10), Each(0.0f));
  EXPECT_THAT(noise({.shot_hz = {1000, 1000}, .hot_pixels = {1, 1}}, 0), Each(0.0f));
  EXPECT_EQ(noise(kShotAndLeak, 1, 1), noise(kShotAndLeak, 1, 1));
  EXPECT_EQ(noise(kShotAndLeak, 1, 1, 2), noise(kShotAndLeak, 1, 1, 3)) << "no hot pixels";
  EXPECT_NE(noise(kShotAndLeak, 1, 1), noise(kShotAndLeak, 1, 2));
}

TEST(Noise, RatesAreDrawnUniformlyForEachPair) {
  // A rate of 200..600 Hz over 1 s gives so many events a pixel, within 0.5 of them.
  constexpr int kPairs = 200;
  double least = 600, most = 200, total = 0;
  const VolumeShape shape{1, {20, 100}};
  for (int pair = 0; pair < kPairs; ++pair) {
    const std::vector<float> volume = noise({.leak_hz = {200, 600}}, 1, pair, 2, shape);
    const double rate = std::accumulate(volume.begin(), volume.end(), 0.0) / 2000;
    least = std::min(least, rate);
    most = std::max(most, rate);
    total += rate;
  }
  EXPECT_GT(least, 197);
  EXPECT_LT(least, 220);
  EXPECT_LT(most, 603);
  EXPECT_GT(most, 580);
  EXPECT_NEAR(total / kPairs, 400, 5 * 400 / std::sqrt(12.0 * kPairs));
}

constexpr NoiseSpec kHotNoise{.hot_pixels = {0.1, 0.1}};

TEST(HotPixels, AreACamerasAndOfASmallerShareAmongThoseOfALarger) {
  // Over 10 s the slowest has 50 events: none is silent.
  const std::vector<bool> hot = struck(noise(kHotNoise, 10, 1));
  EXPECT_EQ(struck(noise(kHotNoise, 10, 7)), hot);
  EXPECT_NE(noise(kHotNoise, 10, 1), noise(kHotNoise, 10, 7)) << "their events are the pair's";
  EXPECT_NE(struck(noise(kHotNoise, 10, 1, /*camera=*/3)), hot);
  const double count = static_cast<double>(std::ranges::count(hot, true));
  EXPECT_NEAR(count, 0.1 * kCameraPixels, 5 * std::sqrt(0.1 * 0.9 * kCameraPixels));
  const std::vector<bool> more = struck(noise(kHotNoise, 10));
  const std::vector<bool> few = struck(noise({.hot_pixels = {0.02, 0.02}}, 10));
  EXPECT_GT(std::ranges::count(few, true), 0);
  for (std::size_t i = 0; i < more.size(); ++i) EXPECT_LE(few[i], more[i]);
}

TEST(HotPixels, HaveOnePolarityAndARateOfTheirOwn) {
  const std::vector<float> volume = noise({.hot_pixels = {1, 1}}, 1000);
  int positive = 0, below_the_middle = 0;
  double ends = 0, all = 0;
  const auto pixels = static_cast<std::size_t>(kCameraPixels);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    double events[2] = {};
    for (std::size_t channel = 0; channel < 18; ++channel) {
      const double value = volume[channel * pixels + pixel];
      events[channel / 9] += value;
      if (channel % 9 == 0 || channel % 9 == 8) ends += value;
    }
    ASSERT_TRUE((events[0] == 0) != (events[1] == 0));
    const double count = events[0] + events[1];
    ASSERT_GT(count, 5000 - five_deviations(5000));
    ASSERT_LT(count, 100000 + five_deviations(100000));
    positive += events[0] > 0;
    below_the_middle += count < 1000 * std::sqrt(5.0 * 100.0);
    all += count;
  }
  EXPECT_NEAR(positive, kCameraPixels / 2, 5 * std::sqrt(kCameraPixels / 4));
  EXPECT_NEAR(below_the_middle, kCameraPixels / 2, 5 * std::sqrt(kCameraPixels / 4))
      << "log-uniform";
  EXPECT_NEAR(ends / all, 1.0 / 8, 1e-3);
}

TEST(Noise, OfOnePixelAndOneBin) {
  const NoiseSpec spec{.shot_hz = {100, 100}, .leak_hz = {50, 50}, .hot_pixels = {1, 1}};
  const std::vector<float> volume = noise(spec, 1000, 1, 2, {1, {1, 1}});
  ASSERT_EQ(volume.size(), 2u);
  // 100000 positive and 50000 negative, and of one polarity 5000 to 100000 of a hot pixel.
  EXPECT_GT(volume[0], 100000 - five_deviations(1e5));
  EXPECT_GT(volume[1], 50000 - five_deviations(5e4));
  const double hot = volume[0] + volume[1] - 150000.0;
  EXPECT_GT(hot, 5000 - five_deviations(1.5e5));
  EXPECT_LT(hot, 100000 + five_deviations(2.5e5));
  EXPECT_THAT(noise({}, 1, 1, 2, {1, {0, 0}}), ::testing::IsEmpty());
}

TEST(Noise, OfEnormousRatesIsFiniteAndNeedsAVolumeOfItsShape) {
  const NoiseSpec spec{.shot_hz = {kMostNoise_hz, kMostNoise_hz},
                       .leak_hz = {kMostNoise_hz, kMostNoise_hz},
                       .hot_pixels = {1, 1}};
  for (const double duration_s : {1e9, 1e25}) {
    for (const float value : noise(spec, duration_s)) {
      ASSERT_TRUE(std::isfinite(value));
      ASSERT_GT(value, 0);
    }
  }
  std::vector<float> volume(7);
  EXPECT_THROWS(
      add_noise(kShotAndLeak, 1, kCameraShape, {CounterRandom(2), CounterRandom(1)}, volume),
      std::invalid_argument, "expected a volume of 109080 values, got 7");
}

}  // namespace
}  // namespace eventgan
