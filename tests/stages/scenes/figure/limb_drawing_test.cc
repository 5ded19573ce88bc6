#include "stages/scenes/figure/limb_drawing.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

constexpr Intrinsics kCamera{100, 100, 10, 10};
constexpr ImageSize kSize{21, 31};

/// A bar 10 px long and 2 px in radius at a distance of 1 m: 100 px a metre.
Limb3d bar() { return {{0, 0, 1000}, {100, 0, 1000}, 20, {100, 100, 100}}; }

TEST(LimbDrawing, ProjectsAndScales) {
  const DrawnLimb drawn = drawn_limb(bar(), kCamera);
  EXPECT_EQ(drawn.from, (Point{10, 10}));
  EXPECT_EQ(drawn.to, (Point{20, 10}));
  EXPECT_DOUBLE_EQ(drawn.radius, 2);
  // Centres from 8 to 22 and 8 to 12, edges half a pixel on.
  EXPECT_EQ(bounds_of(drawn), (Rectangle{8.5, 8.5, 22.5, 12.5}));
}

TEST(LimbDrawing, PlacesBesideAndBeyondTheEnds) {
  const DrawnLimb drawn = drawn_limb(bar(), kCamera);
  EXPECT_DOUBLE_EQ(place_on(drawn, {15, 13}).distance, 3);
  EXPECT_DOUBLE_EQ(place_on(drawn, {15, 13}).along, 0.5);
  EXPECT_DOUBLE_EQ(place_on(drawn, {23, 14}).distance, 5);  // 3 beyond, 4 beside
  EXPECT_DOUBLE_EQ(place_on(drawn, {0, 10}).along, 0);
  const DrawnLimb ball{{5, 5}, {5, 5}, 1, 1000};
  EXPECT_DOUBLE_EQ(place_on(ball, {8, 9}).distance, 5);
}

TEST(LimbDrawing, CoversItsPixelsAndSoftensItsEdge) {
  std::vector<Colour> canvas(kSize.pixel_count());
  std::vector<int> objects(kSize.pixel_count(), -1);
  draw_limb(bar(), kCamera, Texture(CounterRandom(1)), 5, kSize, canvas, objects);
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y) * kSize.width + x; };
  EXPECT_EQ(objects[at(15, 10)], 5);
  EXPECT_EQ(objects[at(15, 12)], 5);
  EXPECT_EQ(objects[at(15, 13)], -1);
  EXPECT_GT(canvas[at(15, 10)].red, 70);  // pattern from 0.75
  EXPECT_GT(canvas[at(15, 12)].red, 0);   // on the edge: half covered
  EXPECT_LT(canvas[at(15, 12)].red, 0.5f * 1.25f * 100);
  EXPECT_EQ(canvas[at(15, 13)].red, 0);  // a pixel off
}

TEST(LimbDrawing, WhatLiesOutsideThePictureIsCut) {
  std::vector<Colour> canvas(kSize.pixel_count());
  std::vector<int> objects(kSize.pixel_count(), -1);
  Limb3d long_bar = bar();
  long_bar.from.x = -5000;
  long_bar.to.x = 5000;
  draw_limb(long_bar, kCamera, Texture(CounterRandom(1)), 0, kSize, canvas, objects);
  EXPECT_EQ(objects[10 * kSize.width], 0);
  EXPECT_EQ(objects[10 * kSize.width + kSize.width - 1], 0);
}

}  // namespace
}  // namespace eventgan
