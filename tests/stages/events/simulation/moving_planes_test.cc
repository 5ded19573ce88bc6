#include "stages/events/simulation/moving_planes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/stages/events/simulation/simulated_images.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;
using testing::exact_sensor;
using ::testing::IsEmpty;
using testing::textured_image;

constexpr std::uint8_t kDark = 60;
constexpr std::uint8_t kBright = 200;

GreyImage constant_image(ImageSize size, std::uint8_t value) {
  return {size, std::vector<std::uint8_t>(size.pixel_count(), value)};
}

/// Dark on the left, bright on the right half.
GreyImage edge_image(ImageSize size) {
  GreyImage image = constant_image(size, kDark);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const std::size_t width = static_cast<std::size_t>(size.width);
    if (i % width >= width / 2) image.pixels[i] = kBright;
  }
  return image;
}

/// A plane that covers the image, shows texture 0 pixel for pixel and moves by `x_px`; nothing
/// between the grey values and the frames or the sensor but the scale of the intensity.
PlaneScene plain_scene(ImageSize size, double x_px, double threshold) {
  PlaneScene scene;
  scene.size = size;
  Plane background;
  background.texture.exponent = 1;
  background.motion.shift_px = {x_px, 0};
  scene.planes.push_back(background);
  scene.sensor = exact_sensor(threshold);
  scene.sensor.log_epsilon = 1e-6;
  scene.gamma = 1;
  return scene;
}

/// The column of pixels where the edge's bright side begins in the first row.
int edge_column(const GreyImage& frame) {
  for (int x = 1; x < frame.size.width; ++x) {
    if (frame.pixels[static_cast<std::size_t>(x)] > frame.pixels[static_cast<std::size_t>(x - 1)]) {
      return x;
    }
  }
  return -1;
}

void expect_sound(const SimulatedPair& pair, ImageSize size) {
  EXPECT_EQ(pair.previous.size, size);
  EXPECT_EQ(pair.next.size, size);
  EXPECT_EQ(pair.previous.pixels.size(), size.pixel_count());
  EXPECT_EQ(pair.next.pixels.size(), size.pixel_count());
  EXPECT_GT(pair.threshold.mean, 0);
  double last_s = 0;
  for (const Event& event : pair.events) {
    ASSERT_TRUE(event.x >= 0 && event.x < size.width && event.y >= 0 && event.y < size.height);
    ASSERT_GE(event.t_s, last_s);
    last_s = event.t_s;
  }
  EXPECT_TRUE(pair.events.empty() || pair.events.front().t_s > 0);
  EXPECT_LE(last_s, pair.duration_s);
}

TEST(SimulatePlanes, IsAFunctionOfItsArguments) {
  const std::vector<GreyImage> textures = {textured_image({60, 80}), textured_image({90, 70}, 9)};
  const ImageSize size{40, 48};
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    EXPECT_EQ(simulate_planes(textures, size, CounterRandom(seed)),
              simulate_planes(textures, size, CounterRandom(seed)));
  }
  EXPECT_NE(simulate_planes(textures, size, CounterRandom(1)),
            simulate_planes(textures, size, CounterRandom(2)));
}

TEST(SimulatePlanes, TakesAnySizeAndTexture) {
  const std::vector<std::vector<GreyImage>> all_textures = {{textured_image({200, 300})},
                                                            {textured_image({5, 8})},
                                                            {textured_image({1, 300})},
                                                            {constant_image({1, 1}, 99)},
                                                            {constant_image({30, 30}, 0)}};
  for (const std::vector<GreyImage>& textures : all_textures) {
    for (const ImageSize size : {ImageSize{16, 16}, {1, 1}, {1, 40}, {33, 17}}) {
      for (std::uint64_t seed = 0; seed < 16; ++seed) {
        SCOPED_TRACE(::testing::Message() << to_string(size) << " seed " << seed);
        expect_sound(simulate_planes(textures, size, CounterRandom(seed)), size);
      }
    }
  }
}

TEST(SimulatePlanes, RefusesNoTextures) {
  EXPECT_THROWS(simulate_planes({}, {16, 16}, CounterRandom(1)), std::invalid_argument,
                "expected textures and a size, got 0 textures, 16x16");
}

TEST(SimulatePlaneScene, StillScenesAndConstantTexturesGiveNoEvents) {
  std::vector<GreyImage> textures = {textured_image({60, 80})};
  PlaneScene scene = plain_scene({30, 40}, 0, 0.1);
  scene.sensor.threshold_spread = 0.02;
  scene.level_spread = 1;
  scene.cutoff_hz = 100;
  scene.exposure = 0.5;
  SimulatedPair pair = simulate_plane_scene(scene, textures, CounterRandom(1));
  EXPECT_THAT(pair.events, IsEmpty());
  EXPECT_EQ(pair.previous, pair.next);
  textures = {constant_image({50, 50}, 120)};
  scene = plain_scene({30, 40}, 17.3, 0.01);
  scene.planes.front().texture.mean_intensity = 0.25;  // 63.75 levels: no tie to round
  scene.planes.front().motion.linear = {0.1, -0.2, 0.2, 0.1};
  scene.planes.front().motion.perspective_per_px = {0.002, 0.001};
  scene.planes.front().motion.acceleration = 0.5;
  scene.cutoff_hz = 100;
  pair = simulate_plane_scene(scene, textures, CounterRandom(1));
  EXPECT_THAT(pair.events, IsEmpty());
  EXPECT_THAT(pair.next.pixels, Each(pair.next.pixels.front()));
}

TEST(SimulatePlaneScene, AnEdgeThatMovesOnePixelChangesOneColumn) {
  const std::vector<GreyImage> textures = {edge_image({64, 64})};
  // floor(ln(200 / 60) / 0.25) = floor(1.204 / 0.25) events a pixel.
  constexpr std::size_t kEvents = 4;
  for (const double x_px : {1.0, -1.0}) {
    const ImageSize size{16, 33};
    const PlaneScene scene = plain_scene(size, x_px, 0.25);
    const SimulatedPair pair = simulate_plane_scene(scene, textures, CounterRandom(1));
    expect_sound(pair, size);
    // To the right the dark side covers the bright one's first column; to the left, the other way.
    const int before = edge_column(pair.previous);
    const int after = edge_column(pair.next);
    EXPECT_EQ(after - before, static_cast<int>(x_px));
    EXPECT_EQ(pair.events.size(), kEvents * static_cast<std::size_t>(size.height));
    for (const Event& event : pair.events) {
      EXPECT_EQ(event.x, std::min(before, after));
      EXPECT_EQ(event.positive, x_px < 0);
    }
  }
}

TEST(SimulatePlaneScene, AHigherThresholdGivesFewerEvents) {
  const std::vector<GreyImage> textures = {textured_image({100, 100})};
  PlaneScene scene = plain_scene({40, 40}, 6, 0);
  scene.level_spread = 1;
  std::size_t last = std::numeric_limits<std::size_t>::max();
  for (const double threshold : {0.05, 0.1, 0.2, 0.4, 0.8}) {
    scene.sensor.positive_threshold = scene.sensor.negative_threshold = threshold;
    const std::size_t count = simulate_plane_scene(scene, textures, CounterRandom(1)).events.size();
    EXPECT_LT(count, last);
    last = count;
  }
}

TEST(SimulatePlaneScene, SaysTheThresholdInUnitsOfTheFrames) {
  const std::vector<GreyImage> textures = {edge_image({64, 64})};
  PlaneScene scene = plain_scene({16, 32}, 1, 0);
  scene.sensor.positive_threshold = 0.2;
  scene.sensor.negative_threshold = 0.8;
  scene.gamma = 0.5;
  const ContrastThreshold threshold =
      simulate_plane_scene(scene, textures, CounterRandom(1)).threshold;
  EXPECT_DOUBLE_EQ(threshold.mean, 0.2);
  EXPECT_DOUBLE_EQ(threshold.ratio, 4);
  // So a pixel's events times that are what the frames' logarithm moves by, up to one threshold.
  scene.sensor.positive_threshold = scene.sensor.negative_threshold = 0.1;
  const SimulatedPair pair = simulate_plane_scene(scene, textures, CounterRandom(1));
  const auto column = static_cast<std::size_t>(edge_column(pair.previous));
  const double change = std::log(static_cast<double>(pair.previous.pixels[column]) /
                                 static_cast<double>(pair.next.pixels[column]));
  EXPECT_NEAR(static_cast<double>(pair.events.size()) / 16 * pair.threshold.mean, change,
              pair.threshold.mean);
}

TEST(SimulatePlaneScene, FramesShowTheToneCurveAndAreClipped) {
  const std::vector<GreyImage> textures = {constant_image({20, 20}, 77)};
  PlaneScene scene = plain_scene({8, 9}, 3, 0.2);
  scene.planes.front().texture.mean_intensity = 0.25;
  scene.gamma = 0.5;
  scene.gain = 0.8;
  // 255 · 0.8 · √0.25
  EXPECT_THAT(simulate_plane_scene(scene, textures, CounterRandom(1)).previous.pixels, Each(102));
  scene.gain = 2.5;
  EXPECT_THAT(simulate_plane_scene(scene, textures, CounterRandom(1)).next.pixels, Each(255));
  scene.gain = 1e-6;
  EXPECT_THAT(simulate_plane_scene(scene, textures, CounterRandom(1)).next.pixels, Each(0));
}

TEST(SimulatePlaneScene, ReadNoiseIsGaussian) {
  const std::vector<GreyImage> textures = {constant_image({20, 20}, 77)};
  const ImageSize size{100, 100};
  PlaneScene scene = plain_scene(size, 0, 0.2);
  scene.planes.front().texture.mean_intensity = 0.5;
  scene.read_noise_levels = 2;
  const SimulatedPair pair = simulate_plane_scene(scene, textures, CounterRandom(1));
  double squares = 0;
  for (const std::uint8_t value : pair.previous.pixels) squares += std::pow(value - 127.5, 2);
  // Of variance 2² and 1/12 by rounding; four standard errors of it, √(2/n).
  const double n = static_cast<double>(size.pixel_count());
  EXPECT_NEAR(squares / n, 4 + 1.0 / 12, 4 * 4 * std::sqrt(2 / n));
  EXPECT_NE(pair.previous, pair.next);
  EXPECT_THAT(pair.events, IsEmpty());
}

TEST(SimulatePlaneScene, AnExposureIsCentredOnItsFrame) {
  const std::vector<GreyImage> textures = {edge_image({64, 64})};
  // Half of a duration in which the edge moves by 4 px: from 1 px before its place to 1 px behind.
  PlaneScene scene = plain_scene({16, 32}, 4, 0.2);
  const int sharp = edge_column(simulate_plane_scene(scene, textures, CounterRandom(1)).previous);
  scene.exposure = 0.5;
  const SimulatedPair pair = simulate_plane_scene(scene, textures, CounterRandom(1));
  for (const auto& [frame, edge] : {std::pair{pair.previous, sharp}, {pair.next, sharp + 4}}) {
    const double dark = frame.pixels[static_cast<std::size_t>(edge - 2)];
    const double bright = frame.pixels[static_cast<std::size_t>(edge + 1)];
    // A pixel beside the edge sees it for half of the time, by 0 to 1 of a pixel: a quarter.
    EXPECT_NEAR(frame.pixels[static_cast<std::size_t>(edge - 1)], dark + 0.25 * (bright - dark), 1);
    EXPECT_NEAR(frame.pixels[static_cast<std::size_t>(edge)], bright - 0.25 * (bright - dark), 1);
  }
}

TEST(SimulatePlaneScene, TheLowPassDelaysALightThatRises) {
  const std::vector<GreyImage> textures = {constant_image({20, 20}, 77)};
  PlaneScene scene = plain_scene({2, 3}, 0, 0.2);
  scene.duration_s = 1;
  scene.light_change = 1;
  constexpr double kLag = 0.1;
  scene.cutoff_hz = 1 / (2 * std::numbers::pi * kLag);
  const std::vector<Event> events = simulate_plane_scene(scene, textures, CounterRandom(1)).events;
  // V ~ 1 + u - lag: 0.9 at first, and e^0.2 as much at each event.
  ASSERT_EQ(events.size(), 3 * scene.size.pixel_count());
  for (std::size_t i = 0; i < events.size(); ++i) {
    const double k = 1 + static_cast<double>(i / scene.size.pixel_count());
    // Within a step, 1/16 s, a line stands for the logarithm: off by up to (1/16)²/8/0.9² in it.
    EXPECT_NEAR(events[i].t_s, kLag - 1 + (1 - kLag) * std::exp(0.2 * k), 2e-3);
    EXPECT_TRUE(events[i].positive);
  }
}

TEST(SimulatePlaneScene, AShapeHidesWhatMovesBehindIt) {
  const std::vector<GreyImage> textures = {textured_image({100, 100}),
                                           constant_image({10, 10}, 50)};
  PlaneScene scene = plain_scene({40, 40}, 8, 0.1);
  Plane box;
  box.texture.image = 1;
  box.outline = {{10, 10}, {29, 10}, {29, 29}, {10, 29}};
  scene.planes.push_back(box);
  const std::vector<Event> events = simulate_plane_scene(scene, textures, CounterRandom(1)).events;
  const auto lies_inside = [](const Event& event) {
    return std::clamp(event.x, 11, 28) == event.x && std::clamp(event.y, 11, 28) == event.y;
  };
  EXPECT_GT(events.size(), 1000u);
  EXPECT_EQ(std::ranges::count_if(events, lies_inside), 0);
  // And one that moves gives events where it was and where it went, ahead of it and behind.
  scene.planes[0].motion.shift_px = {0, 0};
  scene.planes[1].motion.shift_px = {5, 0};
  for (const Event& event : simulate_plane_scene(scene, textures, CounterRandom(1)).events) {
    EXPECT_TRUE(event.x <= 15 || (event.x >= 29 && event.x <= 35)) << event.x;
    EXPECT_TRUE(event.x >= 9 && event.y >= 9 && event.y <= 30) << event.x << ", " << event.y;
  }
}

TEST(SimulatePlaneScene, APixelMayBeAboutToSignalAtFirst) {
  const std::vector<GreyImage> textures = {constant_image({20, 20}, 77)};
  PlaneScene scene = plain_scene({60, 60}, 0, 0.4);
  scene.light_change = 0.2;  // ln 1.2 = 0.182 of log intensity, less than half a threshold
  EXPECT_THAT(simulate_plane_scene(scene, textures, CounterRandom(1)).events, IsEmpty());
  scene.level_spread = 1;
  // Levels are triangular within ± 1 threshold: a share of (0.182 / 0.4)² / 2 is that near.
  const double near = std::pow(std::log(1.2) / 0.4, 2) / 2;
  const double n = static_cast<double>(scene.size.pixel_count());
  EXPECT_NEAR(
      static_cast<double>(simulate_plane_scene(scene, textures, CounterRandom(1)).events.size()) /
          n,
      near, 4 * std::sqrt(near * (1 - near) / n));
}

TEST(SimulatePlaneScene, RefusesWhatIsNoScene) {
  const std::vector<GreyImage> textures = {textured_image({20, 20})};
  const PlaneScene sound = plain_scene({8, 8}, 1, 0.2);
  const auto refused = [&](const PlaneScene& scene, std::span<const GreyImage> images,
                           const std::string& words) {
    EXPECT_THROWS(simulate_plane_scene(scene, images, CounterRandom(1)), std::invalid_argument,
                  words);
  };
  refused(sound, {}, "expected a texture below 0, got 0");
  refused(sound, std::vector<GreyImage>{{{0, 0}, {}}}, "as texture, got 0x0 with 0 pixels");
  refused(sound, std::vector<GreyImage>{{{2, 2}, {1, 2, 3}}}, "as texture, got 2x2 with 3 pixels");
  PlaneScene scene = sound;
  scene.planes.front().texture.image = 1;
  refused(scene, textures, "expected a texture below 1, got 1");
  scene = sound;
  scene.planes.clear();
  refused(scene, textures, "expected a scene with a background, got 8x8, 0 planes, 0.05");
  scene = sound;
  scene.planes.front().outline = {{0, 0}, {5, 0}, {5, 5}};
  refused(scene, textures, "expected a scene with a background, got 8x8, 1 planes, 0.05");
  scene = sound;
  scene.size = {0, 8};
  refused(scene, textures, "expected a scene with a background, got 8x0");
  for (const double duration_s : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    scene = sound;
    scene.duration_s = duration_s;
    refused(scene, textures, "1 planes, " + std::to_string(duration_s) + " s");
  }
}

}  // namespace
}  // namespace eventgan
