#include "pipeline/realism/still_pixels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace eventgan {
namespace {

using ::testing::ElementsAre;

GreyImage grey(ImageSize size, std::uint8_t level) {
  return {size, std::vector<std::uint8_t>(size.pixel_count(), level)};
}

std::size_t still_count(const GreyImage& previous, const GreyImage& next) {
  return static_cast<std::size_t>(
      std::ranges::count(find_still_pixels(previous, next, {}, 0.1).still, 1));
}

TEST(FindStillPixels, TakesAChangeOfTwoLevelsAndLeavesOutClippedOnes) {
  EXPECT_EQ(still_count(grey({7, 9}, 100), grey({7, 9}, 102)), 63u);
  EXPECT_EQ(still_count(grey({7, 9}, 100), grey({7, 9}, 98)), 63u);
  EXPECT_EQ(still_count(grey({7, 9}, 100), grey({7, 9}, 103)), 0u);
  EXPECT_EQ(still_count(grey({1, 1}, 100), grey({1, 1}, 100)), 1u);
  for (const std::uint8_t level : {0, 255}) {
    EXPECT_EQ(still_count(grey({7, 9}, level), grey({7, 9}, level)), 0u) << int{level};
  }
  EXPECT_EQ(still_count(grey({7, 9}, 1), grey({7, 9}, 0)), 0u);
  EXPECT_EQ(still_count(grey({7, 9}, 1), grey({7, 9}, 1)), 63u);
}

TEST(FindStillPixels, LeavesOutWhatIsNearAChange) {
  // One pixel changes by 51: the mean over 25 pixels is above 2, at an inner pixel within reach. A
  // change by 50 gives 2 there, and more where the image's border cuts the neighbourhood.
  const GreyImage previous = grey({9, 11}, 100);
  GreyImage next = previous;
  const std::size_t middle = 4 * 11 + 5;
  next.pixels[middle] = 151;
  EXPECT_EQ(still_count(previous, next), 99u - 25u);
  next.pixels[middle] = 150;
  EXPECT_EQ(still_count(previous, next), 99u - 1u);
  next = previous;
  next.pixels[0] = 119;  // 19 / 9 at the corner, 19 / 12 and less beside it
  EXPECT_EQ(still_count(previous, next), 99u - 1u);
  next.pixels[0] = 125;  // 25 / 12 = 2.08 beside it, 25 / 16 diagonally
  EXPECT_EQ(still_count(previous, next), 99u - 3u);
}

TEST(FindStillPixels, KeepsTheEventsOfThesePixelsAlone) {
  const GreyImage previous = grey({5, 20}, 100);
  GreyImage next = previous;
  next.pixels[0] = 200;
  const Event events[] = {
      {0, 0, 0.1, true}, {19, 4, 0.1, true}, {19, 4, 0.2, true}, {10, 1, 0.3, false}};
  const StillPixels found = find_still_pixels(previous, next, events, 0.5);
  EXPECT_EQ(found.duration_s, 0.5);
  EXPECT_THAT(found.positive, ElementsAre(99, 99));
  EXPECT_THAT(found.negative, ElementsAre(30));
}

/// A pair of 1000 still pixels in 0.1 s, of which the first so many have an event.
StillPixels pair_of(std::uint32_t positive, std::uint32_t negative) {
  StillPixels pair{0.1, std::vector<std::uint8_t>(1000, 1), {}, {}};
  for (std::uint32_t i = 0; i < positive; ++i) pair.positive.push_back(i);
  for (std::uint32_t i = 0; i < negative; ++i) pair.negative.push_back(i);
  return pair;
}

NoiseFit fit_of(const std::vector<StillPixels>& pairs) {
  return fit_noise(std::vector<std::vector<StillPixels>>{pairs}).value();
}

TEST(FitNoise, TellsLeakFromShotNoise) {
  // 30 and 20 events of 1000 pixels in 0.1 s.
  const NoiseFit fit = fit_of({pair_of(30, 20)});
  EXPECT_NEAR(fit.positive_hz, 0.3, 1e-9);
  EXPECT_NEAR(fit.negative_hz, 0.2, 1e-9);
  EXPECT_NEAR(fit.noise.shot_hz[0], 0.4, 1e-9);
  EXPECT_NEAR(fit.noise.leak_hz[0], 0.1, 1e-9);
  EXPECT_EQ(fit.noise.shot_hz[1], fit.noise.shot_hz[0]);
  EXPECT_NEAR(fit.pixel_seconds, 100, 1e-9);
  EXPECT_EQ(fit.pixels, 1000u);
  EXPECT_EQ(fit.pairs, 1u);
  // No camera leaks negative events: what has more of them is shot noise for the rarer polarity.
  EXPECT_EQ(fit_of({pair_of(20, 30)}).noise.leak_hz[0], 0);
  EXPECT_NEAR(fit_of({pair_of(20, 30)}).noise.shot_hz[0], 0.4, 1e-9);
}

TEST(FitNoise, OfTenPairsIsTheRangeOfTheirMiddle) {
  // In the mean 500 events of either polarity.
  std::vector<StillPixels> pairs;
  for (std::uint32_t i = 0; i <= 10; ++i) pairs.push_back(pair_of(100 * i, 100 * i));
  EXPECT_NEAR(fit_of(pairs).noise.shot_hz[0], 2, 1e-9);  // of 0, 2, .. 20
  EXPECT_NEAR(fit_of(pairs).noise.shot_hz[1], 18, 1e-9);
  pairs.resize(9);
  EXPECT_NEAR(fit_of(pairs).noise.shot_hz[0], 8, 1e-9);  // the mean of 0, .. 16
  EXPECT_NEAR(fit_of(pairs).noise.shot_hz[1], 8, 1e-9);
}

TEST(FitNoise, OfFewEventsIsNoRange) {
  // 199 or 200 events of either polarity in the mean of all pairs: 400 tell a rate to 5 %.
  const auto range_of = [](std::uint32_t more) {
    std::vector<StillPixels> pairs;
    for (std::uint32_t i = 0; i < 10; ++i) pairs.push_back(pair_of(more + 20 * i, more + 20 * i));
    return fit_of(pairs).noise.shot_hz;
  };
  EXPECT_NEAR(range_of(109)[0], 3.98, 1e-9);
  EXPECT_NEAR(range_of(109)[1], 3.98, 1e-9);
  EXPECT_LT(range_of(110)[0], 3);
  EXPECT_GT(range_of(110)[1], 5);
}

TEST(FitNoise, LeavesOutHotPixels) {
  // In a second every pixel has an event; one has 21, another 20, which is not above 20 times that.
  std::vector<StillPixels> pairs(10, pair_of(100, 0));
  for (std::uint32_t i = 0; i < 10; ++i) {
    for (std::uint32_t pixel = 0; pixel < 100; ++pixel) pairs[i].positive[pixel] = 100 * i + pixel;
  }
  pairs[0].negative.assign(20, 500);
  pairs[1].negative.assign(19, 501);
  const NoiseFit fit = fit_of(pairs);
  EXPECT_EQ(fit.hot_pixels, 1u);
  EXPECT_EQ(fit.noise.hot_pixels[0], 0.001);
  EXPECT_NEAR(fit.positive_hz, 1, 1e-9);
  EXPECT_NEAR(fit.negative_hz, 19 / 999.0, 1e-9);
  ASSERT_EQ(fit.hot.size(), 1u);
  EXPECT_EQ(std::ranges::count(fit.hot[0], 1), 1);
  EXPECT_EQ(fit.hot[0][500], 1);
}

TEST(FitNoise, FindsHotPixelsOfASilentCameraNeitherInFlickerNorInChance) {
  StillPixels pair = pair_of(0, 0);
  for (int event = 0; event < 100; ++event) pair.positive.insert(pair.positive.end(), {3, 700});
  const NoiseFit fit = fit_of({pair});
  EXPECT_EQ(fit.hot_pixels, 2u);
  EXPECT_EQ(fit.positive_hz, 0);
  EXPECT_EQ(fit.noise.leak_hz[0], 0);
  pair = pair_of(0, 0);
  for (int event = 0; event < 20; ++event) {
    for (std::uint32_t pixel = 0; pixel < 900; ++pixel) pair.positive.push_back(pixel);
  }
  EXPECT_EQ(fit_of({pair}).hot_pixels, 0u);
  // 4 events in 0.1 s are 40 a second, and all that a pixel of a silent image has: no hot pixel.
  pair = pair_of(0, 0);
  pair.positive.assign(4, 3);
  EXPECT_EQ(fit_of({pair}).hot_pixels, 0u);
}

TEST(FitNoise, NeedsAHundredStillPixels) {
  StillPixels few = pair_of(0, 0);
  std::fill(few.still.begin() + 99, few.still.end(), 0);
  EXPECT_FALSE(fit_noise(std::vector<std::vector<StillPixels>>{{few}}));
  EXPECT_FALSE(fit_noise({}));
  EXPECT_FALSE(fit_noise(std::vector<std::vector<StillPixels>>(2)));
  const NoiseFit fit = fit_of({few, pair_of(10, 10)});
  EXPECT_EQ(fit.pairs, 1u);
  EXPECT_NEAR(fit.positive_hz, 0.1, 1e-9);
}

TEST(FitNoise, OfAStillImageWithoutEventsIsNoneAndPoolsRecordings) {
  const NoiseFit fit = fit_of({pair_of(0, 0)});
  EXPECT_EQ(fit.noise, NoiseSpec());
  EXPECT_EQ(fit.pixels, 1000u);
  StillPixels large{0.3, std::vector<std::uint8_t>(2000, 1), {}, {}};
  const std::vector<std::vector<StillPixels>> recordings{{pair_of(70, 0)}, {large}};
  EXPECT_NEAR(fit_noise(recordings)->positive_hz, 70 / 700.0, 1e-9);
  EXPECT_EQ(fit_noise(recordings)->pixels, 3000u);
}

}  // namespace
}  // namespace eventgan
