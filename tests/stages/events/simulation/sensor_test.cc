#include "stages/events/simulation/sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "tests/stages/events/simulation/log_pictures.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using testing::intensity_at;
using ::testing::IsEmpty;
using testing::log_picture;
using ::testing::SizeIs;

constexpr ImageSize kOnePixel{1, 1};

/// Float logarithms of the pictures are good to some 1e-7; times scale with 1 / change.
constexpr double kTolerance = 3e-6;

TEST(Sensor, SignalsEachCrossingOfALineAtItsTime) {
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  EXPECT_THAT(sensor.step(log_picture(kOnePixel, -2, spec), 5), IsEmpty());
  const std::vector<Event> rise = sensor.step(log_picture(kOnePixel, -1, spec), 7);
  // floor(1 / 0.3) events, each where -2 + (t - 5) / 2 stands k 0.3 above -2.
  ASSERT_THAT(rise, SizeIs(3));
  for (int k = 1; k <= 3; ++k) {
    EXPECT_NEAR(rise[k - 1].t_s, 5 + 2 * 0.3 * k, kTolerance);
    EXPECT_TRUE(rise[k - 1].positive);
  }
  // The level stands at -1.1; going down from -1 it is crossed by 0.3 at -1.4, -1.7, -2.0.
  const std::vector<Event> fall = sensor.step(log_picture(kOnePixel, -1.95, spec), 8.9);
  ASSERT_THAT(fall, SizeIs(2));
  EXPECT_NEAR(fall[0].t_s, 7 + 2 * 0.4, kTolerance);
  EXPECT_NEAR(fall[1].t_s, 7 + 2 * 0.7, kTolerance);
  EXPECT_FALSE(fall[0].positive);
  EXPECT_FALSE(fall[1].positive);
}

TEST(Sensor, RemembersItsLevelOverManySmallSteps) {
  const SensorSpec spec = exact_sensor(0.25);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -3, spec), 0);
  std::vector<double> times;
  for (int step = 1; step <= 1000; ++step) {
    for (const Event& event : sensor.step(log_picture(kOnePixel, -3 + 0.0021 * step, spec), step)) {
      times.push_back(event.t_s);
    }
  }
  ASSERT_THAT(times, SizeIs(8));  // floor(2.1 / 0.25)
  // A step of 0.0021 in float logarithms of about 3 gives times to 2.4e-7 / 0.0021 of a step.
  for (int k = 1; k <= 8; ++k) EXPECT_NEAR(times[k - 1], 0.25 * k / 0.0021, 1e-3);
}

TEST(Sensor, TakesEachPolaritysThreshold) {
  SensorSpec spec = exact_sensor(0.2);
  spec.negative_threshold = 0.45;
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -2, spec), 0);
  EXPECT_THAT(sensor.step(log_picture(kOnePixel, -1.5, spec), 1), SizeIs(2));  // level -1.6
  EXPECT_THAT(sensor.step(log_picture(kOnePixel, -2.6, spec), 2), SizeIs(2));  // -2.05, -2.5
}

TEST(Sensor, SeesAMovingEdgeOfKnownContrast) {
  // A bright-to-dark edge, 1 log unit, moves right by one pixel a millisecond: pixel x darkens
  // between x and x + 1 ms, and signals floor(1 / 0.3) times.
  constexpr ImageSize kSize{3, 8};
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kSize, CounterRandom(1));
  std::vector<Event> events;
  for (int edge = 0; edge <= kSize.width; ++edge) {
    std::vector<float> picture;
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        picture.push_back(intensity_at(x < edge ? -1.5 : -0.5, spec));
      }
    }
    const std::vector<Event> seen = sensor.step(picture, 1e-3 * edge);
    events.insert(events.end(), seen.begin(), seen.end());
  }
  ASSERT_THAT(events, SizeIs(3 * kSize.pixel_count()));
  std::size_t i = 0;
  for (int x = 0; x < kSize.width; ++x) {
    for (int k = 1; k <= 3; ++k) {
      for (int y = 0; y < kSize.height; ++y, ++i) {
        EXPECT_EQ(events[i].x, x);
        EXPECT_EQ(events[i].y, y);
        EXPECT_FALSE(events[i].positive);
        EXPECT_NEAR(events[i].t_s, 1e-3 * (x + 0.3 * k), 1e-3 * kTolerance);
      }
    }
  }
}

TEST(Sensor, OrdersByTimeThenRowThenColumn) {
  constexpr ImageSize kSize{4, 5};
  const SensorSpec spec = exact_sensor(0.1);
  Sensor sensor(spec, kSize, CounterRandom(1));
  sensor.step(log_picture(kSize, -3, spec), 0);
  std::vector<float> picture = log_picture(kSize, -2.55, spec);
  picture[7] = intensity_at(-3.45, spec);
  picture[11] = intensity_at(-1, spec);
  const std::vector<Event> events = sensor.step(picture, 1);
  EXPECT_THAT(events, SizeIs(19 * 4 + 20 - 1));  // pixel 11 has floor(2 / 0.1) or one less
  EXPECT_TRUE(std::ranges::is_sorted(events, {}, [](const Event& event) {
    return std::tuple(event.t_s, event.y, event.x, event.positive);
  }));
}

TEST(Sensor, PixelsDifferByTheirThresholdSpread) {
  constexpr ImageSize kSize{50, 50};
  SensorSpec spec = exact_sensor(0.5);
  spec.threshold_spread = 0.05;
  Sensor sensor(spec, kSize, CounterRandom(1));
  sensor.step(log_picture(kSize, -2, spec), 0);
  // To 0.5 exactly: pixels whose threshold is below the mean signal, half of them.
  const std::vector<Event> events = sensor.step(log_picture(kSize, -1.5, spec), 1);
  EXPECT_NEAR(static_cast<double>(events.size()), 1250, 4 * 25);
}

TEST(Sensor, StaysSilentWithoutMotionOrNoise) {
  constexpr ImageSize kSize{6, 7};
  SensorSpec spec;
  Sensor sensor(spec, kSize, CounterRandom(1));
  for (int step = 0; step < 50; ++step) {
    EXPECT_THAT(sensor.step(log_picture(kSize, -1, spec), step), IsEmpty());
  }
}

}  // namespace
}  // namespace eventgan
