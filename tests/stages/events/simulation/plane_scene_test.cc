#include "stages/events/simulation/plane_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr ImageSize kSceneSize{96, 128};
constexpr int kScenes = 4000;

/// Four standard deviations of a share among the scenes.
double four_deviations(double share) { return 4 * std::sqrt(share * (1 - share) / kScenes); }

bool rests(const Plane& plane) {
  return plane.motion.shift_px.x == 0 && plane.motion.shift_px.y == 0;
}

TEST(DrawPlaneScene, IsAFunctionOfTheSeed) {
  const auto first_shift = [](std::uint64_t seed) {
    const PlaneScene scene = draw_plane_scene(3, kSceneSize, CounterRandom(seed));
    return scene.planes.front().texture.x_place + scene.duration_s + scene.gain;
  };
  EXPECT_EQ(first_shift(1), first_shift(1));
  EXPECT_NE(first_shift(1), first_shift(2));
}

TEST(DrawPlaneScene, KeepsWithinItsRanges) {
  for (int seed = 0; seed < kScenes; ++seed) {
    const PlaneScene scene =
        draw_plane_scene(3, kSceneSize, CounterRandom(static_cast<std::uint64_t>(seed)));
    ASSERT_EQ(scene.size, kSceneSize);
    ASSERT_GE(scene.duration_s, 0.005);
    ASSERT_LE(scene.duration_s, 0.2);
    ASSERT_GE(scene.planes.size(), 1u);
    ASSERT_LE(scene.planes.size(), 5u);
    ASSERT_LE(std::abs(scene.light_change), 0.3);
    ASSERT_LE(scene.exposure, 0.6);
    ASSERT_TRUE(scene.planes.front().outline.empty());
    for (const Plane& plane : scene.planes) {
      ASSERT_LT(plane.texture.image, 3u);
      const double shift_px = std::hypot(plane.motion.shift_px.x, plane.motion.shift_px.y);
      ASSERT_LE(shift_px, 25 * (1 + 1e-12));
      ASSERT_TRUE(rests(plane) || shift_px >= 0.3 * (1 - 1e-12));
    }
    const double ratio = scene.sensor.positive_threshold / scene.sensor.negative_threshold;
    ASSERT_GE(ratio, 0.5 * (1 - 1e-12));
    ASSERT_LE(ratio, 2 * (1 + 1e-12));
  }
}

TEST(DrawPlaneScene, OneSceneInTwentyIsAtRest) {
  int at_rest = 0;
  int blurred = 0;
  int filtered = 0;
  for (int seed = 0; seed < kScenes; ++seed) {
    const PlaneScene scene =
        draw_plane_scene(1, kSceneSize, CounterRandom(static_cast<std::uint64_t>(seed)));
    bool moves = scene.light_change != 0;
    for (const Plane& plane : scene.planes) moves = moves || !rests(plane);
    at_rest += !moves;
    blurred += scene.exposure > 0;
    filtered += scene.cutoff_hz > 0;
  }
  EXPECT_NEAR(at_rest / double{kScenes}, 0.05, four_deviations(0.05));
  EXPECT_NEAR(blurred / double{kScenes}, 0.5, four_deviations(0.5));
  EXPECT_NEAR(filtered / double{kScenes}, 0.5, four_deviations(0.5));
}

TEST(DrawPlaneScene, RefusesToDrawFromNothing) {
  EXPECT_THROWS(draw_plane_scene(0, kSceneSize, CounterRandom(1)), std::invalid_argument,
                "expected textures and a size, got 0 textures, 128x96");
  EXPECT_THROWS(draw_plane_scene(1, {0, 5}, CounterRandom(1)), std::invalid_argument,
                "expected textures and a size, got 1 textures, 5x0");
}

}  // namespace
}  // namespace eventgan
