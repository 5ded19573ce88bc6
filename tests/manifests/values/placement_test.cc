#include "manifests/values/placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "manifests/values/counter_random.h"

namespace eventgan {
namespace {

ImageSpec spec_of(std::optional<ImageSize> volume, ImageFit fit) {
  ImageSpec spec;
  spec.size = volume;
  spec.fit = fit;
  return spec;
}

TEST(Placement, StretchFillsTheVolume) {
  const Placement placement = place({375, 1242}, spec_of(ImageSize{260, 861}, ImageFit::kStretch));
  EXPECT_EQ(placement, (Placement{{375, 1242}, {260, 861}, {260, 861}, 0, 0}));
  EXPECT_DOUBLE_EQ(placement.scale_x(), 861.0 / 1242);
  EXPECT_DOUBLE_EQ(placement.scale_y(), 260.0 / 375);
}

TEST(Placement, LetterboxFits) {
  // 100 x 50 into 64 x 64: 64/100 < 64/50, so 64 wide and 50 * 0.64 = 32 high; (64 - 32)/2 above.
  EXPECT_EQ(place({50, 100}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox)),
            (Placement{{50, 100}, {32, 64}, {64, 64}, 0, 16}));
  // 50 x 100 the other way round; 31 rows left over of 63: floor(31/2) = 15 in front.
  EXPECT_EQ(place({100, 50}, spec_of(ImageSize{64, 63}, ImageFit::kLetterbox)),
            (Placement{{100, 50}, {64, 32}, {64, 63}, 15, 0}));
}

TEST(Placement, CropCovers) {
  // 100 x 50 over 64 x 64: 64/50 = 1.28, so 128 x 64; half of 64 columns over on each side.
  EXPECT_EQ(place({50, 100}, spec_of(ImageSize{64, 64}, ImageFit::kCrop)),
            (Placement{{50, 100}, {64, 128}, {64, 64}, -32, 0}));
  // 51 x 50 over 50 x 50: one column over; floor(-1/2) = -1, so the left one is cut.
  EXPECT_EQ(place({50, 51}, spec_of(ImageSize{50, 50}, ImageFit::kCrop)),
            (Placement{{50, 51}, {50, 51}, {50, 50}, -1, 0}));
}

TEST(Placement, SidesAreRoundedToTheNearestPixel) {
  // 3 x 2 pixels to a width of 64: 2 * 64/3 = 42.67 rows; 4 x 1 to 10: 2.5, halves up.
  EXPECT_EQ(place({2, 3}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox)).scaled,
            (ImageSize{43, 64}));
  EXPECT_EQ(place({1, 4}, spec_of(ImageSize{64, 10}, ImageFit::kLetterbox)).scaled,
            (ImageSize{3, 10}));
}

TEST(Placement, WithoutSizeTheImageKeepsItsOwn) {
  for (const ImageFit fit : {ImageFit::kStretch, ImageFit::kLetterbox, ImageFit::kCrop}) {
    const Placement placement = place({375, 1242}, spec_of(std::nullopt, fit));
    EXPECT_EQ(placement, (Placement{{375, 1242}, {375, 1242}, {375, 1242}, 0, 0}));
    EXPECT_EQ(placement.source_to_volume(), (std::array<double, 6>{1, 0, 0, 0, 1, 0}));
  }
}

TEST(Placement, MapsPointsAndEdgesByTheEquations) {
  // Twice as large, 10 px borders on the left: the source pixel (0, 0) covers volume pixels 10 and
  // 11, so its centre lies at 10.5; the source's edges 0 and 20 lie at 10 and 50.
  const Placement placement = place({10, 20}, spec_of(ImageSize{20, 60}, ImageFit::kLetterbox));
  ASSERT_EQ(placement, (Placement{{10, 20}, {20, 40}, {20, 60}, 10, 0}));
  EXPECT_EQ(placement.source_to_volume(), (std::array<double, 6>{2, 0, 10.5, 0, 2, 0.5}));
}

TEST(Placement, ShapesWithoutBoundsKeepOnePixel) {
  // 10000 x 1 into 64 x 64: 0.0064 rows, but an image has at least one.
  EXPECT_EQ(place({1, 10000}, spec_of(ImageSize{64, 64}, ImageFit::kLetterbox)),
            (Placement{{1, 10000}, {1, 64}, {64, 64}, 0, 31}));
  EXPECT_EQ(place({1, 1}, spec_of(ImageSize{64, 32}, ImageFit::kCrop)),
            (Placement{{1, 1}, {64, 64}, {64, 32}, -16, 0}));
}

TEST(Placement, HugeImagesDoNotOverflow) {
  constexpr int kMost = std::numeric_limits<int>::max();
  EXPECT_EQ(place({kMost, kMost}, spec_of(ImageSize{8192, 8192}, ImageFit::kLetterbox)).scaled,
            (ImageSize{8192, 8192}));
  EXPECT_EQ(place({kMost, kMost}, spec_of(std::nullopt, ImageFit::kCrop)).scaled,
            (ImageSize{kMost, kMost}));
  // 1 x 2^31 over 8192 x 8192 would be 2^44 pixels high.
  EXPECT_THROW(place({kMost, 1}, spec_of(ImageSize{8192, 8192}, ImageFit::kCrop)),
               std::invalid_argument);
}

TEST(Placement, NothingIsPlacedNowhere) {
  EXPECT_THROW(place({0, 10}, spec_of(ImageSize{64, 64}, ImageFit::kStretch)),
               std::invalid_argument);
  EXPECT_THROW(place({10, -1}, ImageSpec{}), std::invalid_argument);
  EXPECT_THROW(place({10, 10}, spec_of(ImageSize{0, 64}, ImageFit::kStretch)),
               std::invalid_argument);
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

INSTANTIATE_TEST_SUITE_P(Fits, AnyPlacement,
                         ::testing::Values(ImageFit::kStretch, ImageFit::kLetterbox,
                                           ImageFit::kCrop));

}  // namespace
}  // namespace eventgan
