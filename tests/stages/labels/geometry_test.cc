#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "manifests/values/placement.h"
#include "stages/labels/label_mapping.h"

namespace eventgan {
namespace {

/// Placements as place() makes them, of random sizes and every fit; the same in every run.
std::vector<Placement> random_placements() {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> side(1, 2000);
  std::vector<Placement> placements;
  for (int i = 0; i < 200; ++i) {
    for (const ImageFit fit : {ImageFit::kStretch, ImageFit::kLetterbox, ImageFit::kCrop}) {
      ImageSpec spec;
      spec.size = ImageSize{side(random), side(random)};
      spec.fit = fit;
      placements.push_back(place({side(random), side(random)}, spec));
    }
  }
  return placements;
}

/// Points of and around the largest source image.
std::vector<double> coordinates() { return {-1000.5, -1, -0.5, 0, 0.25, 17, 1241, 1999.5, 3000}; }

void expect_near(const Point& got, const Point& expected) {
  EXPECT_NEAR(got.x, expected.x, 1e-9);
  EXPECT_NEAR(got.y, expected.y, 1e-9);
}

TEST(Geometry, PointsAndBoxesComeBackAndMapByTheRecordedMatrix) {
  for (const Placement& placement : random_placements()) {
    for (const double x : coordinates()) {
      const Point point{x, 375 - x};
      expect_near(to_source(placement, to_volume(placement, point)), point);
      const Rectangle box{x, -x, x + 100.25, 50 - x};
      const Rectangle back = to_source(placement, to_volume(placement, box));
      expect_near({back.left, back.top}, {box.left, box.top});
      expect_near({back.right, back.bottom}, {box.right, box.bottom});
      // The edge at x lies half a pixel before the centre of pixel x: at the point x - 0.5.
      const Rectangle edges = to_volume(placement, Rectangle{x, x, x + 1, x + 1});
      expect_near(to_volume(placement, Point{x - 0.5, x - 0.5}),
                  {edges.left - 0.5, edges.top - 0.5});
    }
    const auto m = placement.source_to_volume();
    expect_near(to_volume(placement, Point{12.5, 99}),
                {m[0] * 12.5 + m[1] * 99 + m[2], m[3] * 12.5 + m[4] * 99 + m[5]});
  }
}

TEST(Geometry, NumbersWorkedOutByHand) {
  // Twice as wide, half as high, then 3 to the right and 4 up:
  // x' = (10 + 0.5) 2 - 0.5 + 3 = 23.5, y' = (10 + 0.5) 0.5 - 0.5 - 4 = 0.75.
  const Placement placement{{20, 20}, {10, 40}, {6, 46}, 3, -4};
  EXPECT_EQ(to_volume(placement, Point{10, 10}), (Point{23.5, 0.75}));
  // left 10 2 + 3 = 23, top 10 0.5 - 4 = 1, right 12 2 + 3 = 27, bottom 14 0.5 - 4 = 3.
  EXPECT_EQ(to_volume(placement, Rectangle{10, 10, 12, 14}), (Rectangle{23, 1, 27, 3}));
  const Placement stretched{{375, 1242}, {260, 861}, {260, 861}, 0, 0};
  EXPECT_EQ(to_volume(stretched, Rectangle{0, 0, 1242, 375}), (Rectangle{0, 0, 861, 260}));
}

// Projecting and then mapping must equal projecting with the mapped camera.
TEST(Geometry, AMappedCameraProjectsToMappedPoints) {
  const Intrinsics camera{1145, 1143, 512.5, 515.4};
  const double x_over_z = 0.2;
  const double y_over_z = -0.3;
  const auto project = [&](const Intrinsics& c) {
    return Point{c.focal_x * x_over_z + c.centre_x, c.focal_y * y_over_z + c.centre_y};
  };
  for (const Placement& placement : random_placements()) {
    const Point expected = to_volume(placement, project(camera));
    const Point got = project(to_volume(placement, camera));
    EXPECT_NEAR(got.x, expected.x, 1e-9 * std::abs(expected.x) + 1e-9);
    EXPECT_NEAR(got.y, expected.y, 1e-9 * std::abs(expected.y) + 1e-9);
  }
}

TEST(Clip, CutsToTheImageAndIsNeverInsideOut) {
  const Rectangle image{0, 0, 100, 50};
  for (const double left : {-30.0, -10.0, 0.0, 40.0, 100.0, 130.0}) {
    for (const double top : {-30.0, 0.0, 20.0, 50.0, 70.0}) {
      const Rectangle box{left, top, left + 20, top + 10};
      const Rectangle clipped = clip(box, image);
      EXPECT_GE(clipped.left, 0);
      EXPECT_GE(clipped.top, 0);
      EXPECT_LE(clipped.left, clipped.right);
      EXPECT_LE(clipped.top, clipped.bottom);
      EXPECT_LE(clipped.right, 100);
      EXPECT_LE(clipped.bottom, 50);
      EXPECT_EQ(clip(clipped, image), clipped);
      const bool overlaps = left < 100 && left + 20 > 0 && top < 50 && top + 10 > 0;
      EXPECT_EQ(is_empty(clipped), !overlaps);
    }
  }
}

TEST(Clip, LeavesABoxInsideAndPutsOneOutsideAtTheNearestBorder) {
  const Rectangle image{0, 0, 100, 50}, inside{0, 1.5, 100, 49.25};
  EXPECT_EQ(clip(inside, image), inside);
  EXPECT_EQ(clip(Rectangle{-20, 10, -5, 30}, image), (Rectangle{0, 10, 0, 30}));
  EXPECT_EQ(clip(Rectangle{120, 60, 130, 70}, image), (Rectangle{100, 50, 100, 50}));
  EXPECT_FALSE(is_empty({0, 0, 1, 1}));
  EXPECT_TRUE(is_empty({5, 0, 5, 1}) && is_empty({0, 5, 1, 5}) && is_empty({2, 0, 1, 1}));
}

}  // namespace
}  // namespace eventgan
