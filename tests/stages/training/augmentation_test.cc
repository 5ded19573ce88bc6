#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>

#include "stages/training/training_sample.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

AugmentationSpec no_change() { return {.flip = false}; }

/// A value that says where it is; frames and volume differ by 1000.
float mark(int plane, int y, int x) { return static_cast<float>(100 * plane + 10 * y + x) / 1e4f; }

TrainingSample marked_sample(int bins, ImageSize size) {
  TrainingSample sample;
  sample.shape = {bins, size};
  sample.origin = "recording, frames 3 and 4";
  for (int plane = 0; plane < 2 + 2 * bins; ++plane) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        (plane < 2 ? sample.frames : sample.volume).push_back(mark(plane, y, x));
      }
    }
  }
  sample.network_frames = {99};  // Not looked at.
  return sample;
}

/// A sample of one bin and one pixel with these two frames.
TrainingSample pixel_sample(float previous, float next) {
  return {{1, {1, 1}}, {previous, next}, {}, {0.25f, 0.75f}, std::nullopt, ""};
}

TEST(DrawAugmentation, ReachesEveryPlaceAboutEquallyOften) {
  constexpr int kDraws = 2400;
  std::map<std::pair<int, int>, int> places;
  for (int i = 0; i < kDraws; ++i) {
    const Augmentation drawn = draw_augmentation({7, 8}, {5, 5}, no_change(), CounterRandom(i));
    EXPECT_EQ(drawn.crop, (ImageSize{5, 5}));
    ++places[{drawn.top, drawn.left}];
  }
  ASSERT_EQ(places.size(), 3u * 4u);
  EXPECT_EQ(places.begin()->first, std::make_pair(0, 0));
  EXPECT_EQ(places.rbegin()->first, std::make_pair(2, 3));
  // 200 each but for chance: five standard deviations of 13.5.
  for (const auto& [place, count] : places) EXPECT_NEAR(count, 200, 68);
}

TEST(DrawAugmentation, FlipsEachWayHalfTheTimeIndependently) {
  std::map<std::pair<bool, bool>, int> flips;
  for (int i = 0; i < 1600; ++i) {
    const Augmentation drawn = draw_augmentation({4, 4}, {4, 4}, {}, CounterRandom(i));
    ++flips[{drawn.flip_x, drawn.flip_y}];
    const Augmentation still = draw_augmentation({4, 4}, {4, 4}, no_change(), CounterRandom(i));
    EXPECT_FALSE(still.flip_x || still.flip_y);
  }
  ASSERT_EQ(flips.size(), 4u);
  for (const auto& [flip, count] : flips) EXPECT_NEAR(count, 400, 87);
}

TEST(DrawAugmentation, ReversesHalfTheTimeWhereAsked) {
  int reversed = 0;
  for (int i = 0; i < 1600; ++i) {
    const AugmentationSpec spec{.reverse = true};
    reversed += draw_augmentation({4, 4}, {4, 4}, spec, CounterRandom(i)).reverse;
    EXPECT_FALSE(draw_augmentation({4, 4}, {4, 4}, {}, CounterRandom(i)).reverse);
  }
  EXPECT_NEAR(reversed, 800, 100);  // five standard deviations of 20
}

TEST(DrawAugmentation, DrawsGainAndGammaFromTheirRanges) {
  AugmentationSpec spec;
  spec.gain = {0.5, 1.5};
  spec.gamma = {2, 4};
  double gain = 0, gamma = 0, product = 0;
  for (int i = 0; i < 1000; ++i) {
    const Augmentation drawn = draw_augmentation({4, 4}, {4, 4}, spec, CounterRandom(i));
    EXPECT_TRUE(drawn.gain >= 0.5f && drawn.gain <= 1.5f) << drawn.gain;
    EXPECT_TRUE(drawn.gamma >= 2.0f && drawn.gamma <= 4.0f) << drawn.gamma;
    gain += drawn.gain / 1000;
    gamma += drawn.gamma / 1000;
    product += (drawn.gain - 1.0) * (drawn.gamma - 3.0) / 1000;
  }
  // Five standard deviations of the mean of a uniform number: 5 · length / √12 / √1000.
  EXPECT_NEAR(gain, 1, 0.046);
  EXPECT_NEAR(gamma, 3, 0.092);
  EXPECT_NEAR(product, 0, 0.027) << "drawn independently";
}

TEST(DrawAugmentation, IsAFunctionOfItsArguments) {
  AugmentationSpec spec;
  spec.gain = {0.5, 1.5};
  const auto draw = [&](std::uint64_t seed) {
    return draw_augmentation({400, 400}, {16, 16}, spec, CounterRandom(seed));
  };
  EXPECT_EQ(draw(5).top, draw(5).top);
  EXPECT_EQ(draw(5).left, draw(5).left);
  EXPECT_EQ(draw(5).gain, draw(5).gain);
  std::set<std::pair<int, int>> places;
  for (std::uint64_t seed = 0; seed < 20; ++seed) places.insert({draw(seed).top, draw(seed).left});
  EXPECT_GT(places.size(), 15u);
}

TEST(DrawAugmentation, TakesAnImageOfExactlyTheCropAndRefusesASmallerOne) {
  const Augmentation drawn = draw_augmentation({5, 6}, {5, 6}, {}, CounterRandom(1));
  EXPECT_EQ(drawn.top, 0);
  EXPECT_EQ(drawn.left, 0);
  for (const ImageSize image : {ImageSize{4, 6}, {5, 5}, {0, 0}}) {
    EXPECT_THROWS(draw_augmentation(image, {5, 6}, {}, CounterRandom(1)), std::invalid_argument,
                  "expected a crop within");
  }
  EXPECT_THROWS(draw_augmentation({5, 6}, {0, 6}, {}, CounterRandom(1)), std::invalid_argument,
                "expected a crop within 6x5 pixels, got 6x0 at row 0, column");
}

class AugmentFlips : public ::testing::TestWithParam<std::pair<bool, bool>> {};

TEST_P(AugmentFlips, MovesPixelsOfFramesAndVolumeAlikeAndKeepsChannels) {
  const auto [flip_x, flip_y] = GetParam();
  const TrainingSample sample = marked_sample(2, {6, 9});
  const TrainingSample result =
      augment(sample, {.top = 2, .left = 3, .crop = {3, 5}, .flip_x = flip_x, .flip_y = flip_y});
  ASSERT_EQ(result.shape, (VolumeShape{2, {3, 5}}));
  ASSERT_EQ(result.frames.size(), 2u * 15u);
  ASSERT_EQ(result.volume.size(), 4u * 15u);
  EXPECT_EQ(result.network_frames, result.frames);
  for (int plane = 0; plane < 6; ++plane) {
    for (int y = 0; y < 3; ++y) {
      for (int x = 0; x < 5; ++x) {
        const std::vector<float>& values = plane < 2 ? result.frames : result.volume;
        const int row = 2 + (flip_y ? 2 - y : y), column = 3 + (flip_x ? 4 - x : x);
        EXPECT_EQ(
            values[static_cast<std::size_t>(15 * (plane < 2 ? plane : plane - 2) + 5 * y + x)],
            mark(plane, row, column))
            << "plane " << plane << ", row " << y << ", column " << x;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllFour, AugmentFlips,
                         ::testing::Values(std::pair(false, false), std::pair(true, false),
                                           std::pair(false, true), std::pair(true, true)));

TEST(Augment, ReversedFramesAndPolaritiesChangePlacesAndTheFirstBinIsTheLast) {
  const TrainingSample sample = marked_sample(3, {2, 4});
  const TrainingSample result = augment(sample, {.crop = {2, 4}, .reverse = true});
  const auto plane = [](const std::vector<float>& values, std::ptrdiff_t i) {
    return std::vector<float>(values.begin() + 8 * i, values.begin() + 8 * (i + 1));
  };
  EXPECT_EQ(plane(result.frames, 0), plane(sample.frames, 1));
  EXPECT_EQ(plane(result.frames, 1), plane(sample.frames, 0));
  EXPECT_EQ(result.network_frames, result.frames);
  // A positive event of bin b is a negative one of bin 2 - b: channel b becomes 3 + 2 - b.
  for (std::ptrdiff_t bin = 0; bin < 3; ++bin) {
    EXPECT_EQ(plane(result.volume, 3 + 2 - bin), plane(sample.volume, bin));
    EXPECT_EQ(plane(result.volume, 2 - bin), plane(sample.volume, 3 + bin));
  }
  EXPECT_TRUE(result.origin.ends_with(", reversed"));
}

TEST(Augment, KeepsAWholeSampleOfAnySize) {
  for (const ImageSize size : {ImageSize{1, 1}, {1, 7}, {5, 1}, {33, 17}}) {
    const TrainingSample sample = marked_sample(1, size);
    const TrainingSample result = augment(sample, {.crop = size});
    EXPECT_EQ(result.frames, sample.frames);
    EXPECT_EQ(result.volume, sample.volume);
    EXPECT_EQ(result.shape, sample.shape);
  }
}

TEST(Augment, ChangesTheLightOfTheNetworkFramesAlone) {
  // u = 0.25 and 0.75 → 0.8 u² = 0.05 and 0.45.
  const TrainingSample sample = pixel_sample(-0.5f, 0.5f);
  const TrainingSample result = augment(sample, {.crop = {1, 1}, .gain = 0.8f, .gamma = 2});
  EXPECT_EQ(result.frames, sample.frames);
  EXPECT_EQ(result.volume, sample.volume);
  EXPECT_NEAR(result.network_frames[0], -0.9f, 1e-6f);
  EXPECT_NEAR(result.network_frames[1], -0.1f, 1e-6f);
}

TEST(Augment, TellsTheThresholdAsTheNetworkSeesIt) {
  TrainingSample sample = pixel_sample(-0.5f, 0.5f);
  EXPECT_EQ(augment(sample, {.crop = {1, 1}, .gamma = 2}).threshold, std::nullopt);
  sample.threshold = ContrastThreshold{0.25, 4};
  const auto told = [&](const Augmentation& augmentation) {
    return augment(sample, augmentation).threshold.value();
  };
  EXPECT_EQ(told({.crop = {1, 1}}), *sample.threshold);
  // A gain moves no contrast; ln u^2 moves twice as far as ln u.
  EXPECT_EQ(told({.crop = {1, 1}, .flip_x = true, .gain = 0.5f}), *sample.threshold);
  EXPECT_EQ(told({.crop = {1, 1}, .gamma = 2}), (ContrastThreshold{0.5, 4}));
  // What rises in time falls in reversed time.
  EXPECT_EQ(told({.crop = {1, 1}, .reverse = true}), (ContrastThreshold{0.25, 0.25}));
  EXPECT_EQ(told({.crop = {1, 1}, .reverse = true, .gamma = 0.5f}),
            (ContrastThreshold{0.125, 0.25}));
}

TEST(Augment, KeepsLightInItsRangeAndANanAndNamesTheCrop) {
  const TrainingSample bright =
      augment(pixel_sample(-1, 1), {.crop = {1, 1}, .gain = 1.5f, .gamma = 0.5f});
  EXPECT_EQ(bright.network_frames, (std::vector<float>{-1, 1}));
  const TrainingSample outside =
      augment(pixel_sample(-1.0001f, 0.9f), {.crop = {1, 1}, .gain = 2, .gamma = 0.5f});
  EXPECT_EQ(outside.network_frames, (std::vector<float>{-1, 1}));
  const TrainingSample dark = augment(pixel_sample(-0.3f, 1), {.crop = {1, 1}, .gain = 0});
  EXPECT_EQ(dark.network_frames, (std::vector<float>{-1, -1}));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const TrainingSample result =
      augment(pixel_sample(nan, 0), {.crop = {1, 1}, .gain = 2, .gamma = 2});
  EXPECT_TRUE(std::isnan(result.frames[0]));
  EXPECT_TRUE(std::isnan(result.network_frames[0]));
  const TrainingSample cropped =
      augment(marked_sample(1, {6, 9}), {.top = 2, .left = 3, .crop = {3, 5}, .flip_x = true});
  EXPECT_EQ(cropped.origin, "recording, frames 3 and 4, crop 5x3 at row 2, column 3, flipped in x");
}

TEST(Augment, RefusesACropThatLeavesTheSampleOrASampleThatIsNotWhole) {
  const TrainingSample sample = marked_sample(1, {6, 9});
  constexpr int kHuge = std::numeric_limits<int>::max();
  for (const Augmentation& outside : {Augmentation{.top = 4, .crop = {3, 9}},
                                      {.left = 1, .crop = {6, 9}},
                                      {.top = -1, .crop = {3, 3}},
                                      {.crop = {0, 3}},
                                      {.left = kHuge, .crop = {6, 9}},
                                      {.crop = {kHuge, kHuge}}}) {
    EXPECT_THROWS(augment(sample, outside), std::invalid_argument,
                  "expected a crop within 9x6 pixels");
  }
  TrainingSample torn = sample;
  torn.frames.pop_back();
  EXPECT_THROWS(augment(torn, {.crop = {3, 3}}), std::invalid_argument,
                "expected 2 frames and a volume of 9x6 pixels, got 107 and");
  torn = sample;
  torn.volume.clear();
  EXPECT_THROWS(augment(torn, {.crop = {3, 3}}), std::invalid_argument,
                "expected 2 frames and a volume of 9x6 pixels, got 108 and 0");
}

}  // namespace
}  // namespace eventgan
