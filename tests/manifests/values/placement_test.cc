#include "manifests/values/placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "manifests/values/counter_random.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

ImageSpec spec_of(std::optional<ImageSize> volume, ImageFit fit) {
  ImageSpec spec;
  spec.size = volume;
  spec.fit = fit;
  return spec;
}

TEST(Placement, FitsAsTheKindOfFitSays) {
  const Placement placement = place({375, 1242}, spec_of(ImageSize{260, 861}, ImageFit::kStretch));
  EXPECT_EQ(placement, (Placement{{375, 1242}, {260, 861}, {260, 861}, 0, 0}));
  EXPECT_DOUBLE_EQ(placement.scale_x(), 861.0 / 1242);
  EXPECT_DOUBLE_EQ(placement.scale_y(), 260.0 / 375);
  // 100 x 50 into 64 x 64: 64/100 < 64/50, so 64 wide and 50 * 0.64 = 32 high; (64 - 32)/2 above.
  EXPECT_EQ(place({50, 100}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox)),
            (Placement{{50, 100}, {32, 64}, {64, 64}, 0, 16}));
  // 50 x 100 the other way round; 31 rows left over of 63: floor(31/2) = 15 in front.
  EXPECT_EQ(place({100, 50}, spec_of(ImageSize{64, 63}, ImageFit::kLetterbox)),
            (Placement{{100, 50}, {64, 32}, {64, 63}, 15, 0}));
  // 100 x 50 over 64 x 64: 64/50 = 1.28, so 128 x 64; half of 64 columns over on each side.
  EXPECT_EQ(place({50, 100}, spec_of(ImageSize{64, 64}, ImageFit::kCrop)),
            (Placement{{50, 100}, {64, 128}, {64, 64}, -32, 0}));
  // 51 x 50 over 50 x 50: one column over; floor(-1/2) = -1, so the left one is cut.
  EXPECT_EQ(place({50, 51}, spec_of(ImageSize{50, 50}, ImageFit::kCrop)),
            (Placement{{50, 51}, {50, 51}, {50, 50}, -1, 0}));
  // 3 x 2 pixels to a width of 64: 2 * 64/3 = 42.67 rows; 4 x 1 to 10: 2.5, halves up.
  EXPECT_EQ(place({2, 3}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox)).scaled,
            (ImageSize{43, 64}));
  EXPECT_EQ(place({1, 4}, spec_of(ImageSize{64, 10}, ImageFit::kLetterbox)).scaled,
            (ImageSize{3, 10}));
}

TEST(Placement, WithoutSizeOrBoundsKeepsOnePixelAtLeast) {
  for (const ImageFit fit : {ImageFit::kStretch, ImageFit::kLetterbox, ImageFit::kCrop}) {
    const Placement placement = place({375, 1242}, spec_of(std::nullopt, fit));
    EXPECT_EQ(placement, (Placement{{375, 1242}, {375, 1242}, {375, 1242}, 0, 0}));
    EXPECT_EQ(placement.source_to_volume(), (std::array<double, 6>{1, 0, 0, 0, 1, 0}));
  }
  // 10000 x 1 into 64 x 64: 0.0064 rows, but an image has at least one.
  EXPECT_EQ(place({1, 10000}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox)),
            (Placement{{1, 10000}, {1, 64}, {64, 64}, 0, 31}));
  EXPECT_EQ(place({1, 1}, spec_of(ImageSize{64, 32}, ImageFit::kCrop)),
            (Placement{{1, 1}, {64, 64}, {64, 32}, -16, 0}));
}

TEST(Placement, MapsPointsAndEdgesByTheEquations) {
  // Twice as large, 10 px borders on the left: the source pixel (0, 0) covers volume pixels 10 and
  // 11, so its centre lies at 10.5; the source's edges 0 and 20 lie at 10 and 50.
  const Placement placement = place({10, 20}, spec_of(ImageSize{20, 60}, ImageFit::kLetterbox));
  ASSERT_EQ(placement, (Placement{{10, 20}, {20, 40}, {20, 60}, 10, 0}));
  EXPECT_EQ(placement.source_to_volume(), (std::array<double, 6>{2, 0, 10.5, 0, 2, 0.5}));
}

TEST(Placement, HugeImagesDoNotOverflowAndNothingIsPlacedNowhere) {
  constexpr int kMost = std::numeric_limits<int>::max();
  EXPECT_EQ(place({kMost, kMost}, spec_of(ImageSize{8192, 8192}, ImageFit::kLetterbox)).scaled,
            (ImageSize{8192, 8192}));
  EXPECT_EQ(place({kMost, kMost}, spec_of(std::nullopt, ImageFit::kCrop)).scaled,
            (ImageSize{kMost, kMost}));
  // 1 x 2^31 over 8192 x 8192 would be 2^44 pixels high.
  EXPECT_THROWS(place({kMost, 1}, spec_of(ImageSize{8192, 8192}, ImageFit::kCrop)),
                std::invalid_argument, "expected a scaled image of at most 2147483647 pixels a");
  EXPECT_THROWS(place({0, 10}, spec_of(ImageSize{64, 64}, ImageFit::kStretch)),
                std::invalid_argument, "expected a source image of at least 1x1 pixels, got 10x0");
  EXPECT_THROWS(place({10, -1}, ImageSpec{}), std::invalid_argument,
                "expected a source image of at least 1x1 pixels, got -1x10");
  EXPECT_THROWS(place({10, 10}, spec_of(ImageSize{0, 64}, ImageFit::kStretch)),
                std::invalid_argument, "expected a volume of at least 1x1 pixels, got 64x0");
}

/// What must hold of every placement, whatever the sizes.
class AnyPlacement : public ::testing::TestWithParam<ImageFit> {
 protected:
  static constexpr int kTrials = 3000;

  /// Sizes of all magnitudes: 1..2^12 evenly by logarithm.
  static int side(const CounterRandom& random, std::uint64_t counter) {
    return static_cast<int>(std::exp2(12 * random.uniform(counter)));
  }
  static Placement draw(std::uint64_t trial) {
    const CounterRandom random = CounterRandom(1).keyed("placement");
    const ImageSize source{side(random, 4 * trial), side(random, 4 * trial + 1)};
    const ImageSize volume{side(random, 4 * trial + 2), side(random, 4 * trial + 3)};
    return place(source, spec_of(volume, GetParam()));
  }
};

TEST_P(AnyPlacement, FitsOrCoversWithOneAxisExact) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const Placement p = draw(trial);
    const double ratio_x = static_cast<double>(p.volume.width) / p.source.width;
    const double ratio_y = static_cast<double>(p.volume.height) / p.source.height;
    const bool exact_x = p.scaled.width == p.volume.width;
    const bool exact_y = p.scaled.height == p.volume.height;
    ASSERT_TRUE(GetParam() == ImageFit::kStretch ? exact_x && exact_y : exact_x || exact_y);
    if (GetParam() == ImageFit::kLetterbox) {
      ASSERT_LE(p.scaled.width, p.volume.width);
      ASSERT_LE(p.scaled.height, p.volume.height);
    }
    if (GetParam() == ImageFit::kCrop) {
      ASSERT_GE(p.scaled.width, p.volume.width);
      ASSERT_GE(p.scaled.height, p.volume.height);
    }
    if (GetParam() != ImageFit::kStretch) {
      // Both axes by one ratio, but for rounding to whole pixels and the one that must be left.
      const double ratio =
          GetParam() == ImageFit::kCrop ? std::max(ratio_x, ratio_y) : std::min(ratio_x, ratio_y);
      ASSERT_NEAR(p.scaled.width, std::max(1.0, p.source.width * ratio), 0.5 + 1e-9);
      ASSERT_NEAR(p.scaled.height, std::max(1.0, p.source.height * ratio), 0.5 + 1e-9);
    }
  }
}

TEST_P(AnyPlacement, LiesInTheMiddleTheOddPixelBehind) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const Placement p = draw(trial);
    ASSERT_EQ(p.offset_x, std::floor((p.volume.width - p.scaled.width) / 2.0));
    ASSERT_EQ(p.offset_y, std::floor((p.volume.height - p.scaled.height) / 2.0));
  }
}

TEST_P(AnyPlacement, MatrixAgreesWithPointsAndEdges) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const Placement p = draw(trial);
    const std::array<double, 6> m = p.source_to_volume();
    ASSERT_EQ(m[1], 0);
    ASSERT_EQ(m[3], 0);
    // A point of the source lies half a pixel beyond the edge of its number; so it must in the
    // volume.
    for (const double x : {-0.5, 0.0, p.source.width - 1.0, p.source.width - 0.5}) {
      const double edge = (x + 0.5) * p.scaled.width / p.source.width + p.offset_x;
      ASSERT_NEAR(m[0] * x + m[2] + 0.5, edge, 1e-9 * p.scaled.width + 1e-9);
    }
    for (const double y : {-0.5, 0.0, p.source.height - 1.0, p.source.height - 0.5}) {
      const double edge = (y + 0.5) * p.scaled.height / p.source.height + p.offset_y;
      ASSERT_NEAR(m[4] * y + m[5] + 0.5, edge, 1e-9 * p.scaled.height + 1e-9);
    }
  }
}

FramePair still(const ImageMotion& motion, double label_position = 1) {
  FramePair pair;
  pair.gap_frames = 1;
  pair.label_position = label_position;
  pair.motion = motion;
  return pair;
}

TEST(StillPlacement, AShiftCutsAsMuchOnEitherSideInTheImagesShape) {
  // Shifted by 3 along the longer axis of 48x24: 2 n >= 3 there, so n = 2 along the shorter one.
  const Placement along = place({24, 48}, {}, still({.x_px = 3}));
  EXPECT_EQ(along, (Placement{{24, 48}, {24, 48}, {24, 48}, 0, 0, 4, 2}));
  EXPECT_EQ(along.cut(), (ImageSize{20, 40}));
  EXPECT_EQ(along.scale_x(), 1.2);
  // Along the shorter one n = 3, since n must be whole: 2.5 px do not fit into 2.
  const Placement across = place({24, 48}, {}, still({.y_px = -2.5}, 0));
  EXPECT_EQ(across, (Placement{{24, 48}, {24, 48}, {24, 48}, 0, 0, 6, 3}));
}

TEST(StillPlacement, WithoutAMotionIsThatOfAnyPair) {
  const ImageSpec spec = spec_of(ImageSize{64, 64}, ImageFit::kLetterbox);
  EXPECT_EQ(place({50, 100}, spec, FramePair()), place({50, 100}, spec));
  EXPECT_EQ(place({50, 100}, spec, still({})), place({50, 100}, spec)) << "nothing moves";
  EXPECT_EQ(place({1, 1}, {}, still({}, 0)), place({1, 1}, {}));
}

TEST(StillPlacement, TheWholeImagesPlaceInTheVolumeIsKept) {
  // 50x100 with n = 5: 10 and 5 px a side. What is left, 40x80, comes to lie as 50x100 would: in a
  // letterbox 32x64, 16 px from the top. An edge at 10 (5) lies at 0 (16), one at 90 (45) at 64.
  const Placement placement =
      place({50, 100}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox), still({.y_px = 5}));
  EXPECT_EQ(placement, (Placement{{50, 100}, {32, 64}, {64, 64}, 0, 16, 10, 5}));
  // s = 0.8: a point maps as (x - 10 + 0.5) 0.8 - 0.5 and (y - 5 + 0.5) 0.8 - 0.5 + 16.
  const std::array<double, 6> map = placement.source_to_volume();
  EXPECT_DOUBLE_EQ(map[0], 0.8);
  EXPECT_DOUBLE_EQ(map[2], -9.5 * 0.8 - 0.5);
  EXPECT_DOUBLE_EQ(map[5], -4.5 * 0.8 + 15.5);
}

TEST(StillPlacement, MotionsThatLeaveLessThanHalfAreRefused) {
  EXPECT_NO_THROW(place({16, 16}, {}, still({.x_px = 4})));
  EXPECT_THROWS(place({16, 16}, {}, still({.x_px = 4.01})), std::invalid_argument,
                "expected a motion after which half of each side can be seen");
  EXPECT_THROWS(place({16, 16}, {}, still({.x_px = 100})), std::invalid_argument,
                "expected a motion after which half of each side can be seen");
  EXPECT_THROWS(place({1, 1}, {}, still({.y_px = 0.1})), std::invalid_argument,
                "expected a motion after which half of each side can be seen");
  EXPECT_THROWS(place({16, 16}, {}, still({.angle_deg = 180, .scale = 0.4}, 0)),
                std::invalid_argument,
                "expected a motion after which half of each side can be seen");
  EXPECT_NO_THROW(place({16, 16}, {}, still({.angle_deg = 180}))) << "upside down, but all there";
}

TEST(MovedToLabelled, IsTheMotionOrItsInverse) {
  // About the centre (10, 5) of 21x11, by 90 degrees from x to y, twice as large, then by (1, -2):
  // one pixel right of the centre comes to lie two below it, plus the shift.
  const ImageMotion motion{1, -2, 90, 2};
  const std::array<double, 6> there = moved_to_labelled({11, 21}, still(motion, 1));
  const auto apply = [](const std::array<double, 6>& m, double x, double y) {
    return std::array{m[0] * x + m[1] * y + m[2], m[3] * x + m[4] * y + m[5]};
  };
  const auto moved = apply(there, 11, 5);
  EXPECT_NEAR(moved[0], 10 + 1, 1e-12);
  EXPECT_NEAR(moved[1], 5 + 2 - 2, 1e-12);
  const auto back = apply(moved_to_labelled({11, 21}, still(motion, 0)), moved[0], moved[1]);
  EXPECT_NEAR(back[0], 11, 1e-12);
  EXPECT_NEAR(back[1], 5, 1e-12);
}

TEST(StillPlacement, OfAnyMotionIsTheTightestThatShowsNothingFromOutside) {
  const CounterRandom random = CounterRandom(2).keyed("stills");
  int cut_further = 0;
  for (std::uint64_t trial = 0; trial < 2000; ++trial) {
    const auto between = [&](std::uint64_t counter, double least, double most) {
      return least + (most - least) * random.uniform(8 * trial + counter);
    };
    const ImageSize source{static_cast<int>(between(0, 90, 300)),
                           static_cast<int>(between(1, 90, 300))};
    const FramePair pair =
        still({between(2, -6, 6), between(3, -6, 6), between(4, -4, 4), between(5, 0.95, 1.05)},
              trial % 2 == 0 ? 1 : 0);
    const std::array<double, 6> map = moved_to_labelled(source, pair);
    // Every pixel at the rim of what is left, one by one.
    const auto is_inside = [&](int border_x, int border_y) {
      for (int y = border_y; y < source.height - border_y; ++y) {
        const bool whole_row = y == border_y || y == source.height - border_y - 1;
        const int step = whole_row ? 1 : source.width - 2 * border_x - 1;
        for (int x = border_x; x < source.width - border_x; x += step) {
          const double u = map[0] * x + map[1] * y + map[2];
          const double v = map[3] * x + map[4] * y + map[5];
          const bool inside = u >= -1e-6 && u <= source.width - 1 + 1e-6 && v >= -1e-6 &&
                              v <= source.height - 1 + 1e-6;
          if (!inside) return false;
        }
      }
      return true;
    };
    const Placement placement = place(source, {}, pair);
    ASSERT_TRUE(is_inside(placement.border_x, placement.border_y)) << trial;
    const int shorter = std::min(source.width, source.height);
    const int n = std::min(placement.border_x, placement.border_y);
    ASSERT_EQ(placement.border_x, std::lround(static_cast<double>(n) * source.width / shorter));
    ASSERT_EQ(placement.border_y, std::lround(static_cast<double>(n) * source.height / shorter));
    if (n == 0) continue;
    ++cut_further;
    const auto border = [&](int side) {
      return static_cast<int>(std::lround((n - 1.0) * side / shorter));
    };
    ASSERT_FALSE(is_inside(border(source.width), border(source.height))) << trial;
  }
  EXPECT_GT(cut_further, 1900);
}

INSTANTIATE_TEST_SUITE_P(Fits, AnyPlacement,
                         ::testing::Values(ImageFit::kStretch, ImageFit::kLetterbox,
                                           ImageFit::kCrop));

}  // namespace
}  // namespace eventgan
