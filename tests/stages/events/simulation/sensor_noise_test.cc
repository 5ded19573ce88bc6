#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "stages/events/simulation/sensor.h"
#include "tests/stages/events/simulation/log_pictures.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using ::testing::IsEmpty;
using testing::log_picture;
using ::testing::SizeIs;

constexpr ImageSize kSize{30, 40};

/// Events of a picture that stays as it is for `duration_s`, shown in `steps` steps from t = 0.
std::vector<Event> watch_still(const SensorSpec& spec, double duration_s, int steps,
                               std::uint64_t seed = 1) {
  Sensor sensor(spec, kSize, CounterRandom(seed));
  std::vector<Event> events;
  for (int step = 0; step <= steps; ++step) {
    for (const Event& event :
         sensor.step(log_picture(kSize, -1, spec), duration_s * step / steps)) {
      events.push_back(event);
    }
  }
  return events;
}

TEST(SensorNoise, LeakGivesPositiveEventsAtItsRateWhateverTheThreshold) {
  SensorSpec spec;
  spec.threshold_spread = 0.03;
  spec.leak_rate_hz = 2;
  for (const int steps : {1, 13}) {
    const std::vector<Event> events = watch_still(spec, 3.2, steps);
    ASSERT_THAT(events, SizeIs(6 * kSize.pixel_count()));
    for (std::size_t i = 0; i < events.size(); ++i) {
      EXPECT_TRUE(events[i].positive);
      EXPECT_NEAR(events[i].t_s, 0.5 * std::round(events[i].t_s / 0.5), 1e-9);
    }
  }
}

TEST(SensorNoise, LeakPausesInTheRefractoryTime) {
  SensorSpec spec;
  spec.leak_rate_hz = 2;
  spec.refractory_s = 0.25;
  const std::vector<Event> events = watch_still(spec, 2.1, 4);
  ASSERT_THAT(events, SizeIs(3 * kSize.pixel_count()));  // 0.5, 1.25, 2.0
  EXPECT_NEAR(events.front().t_s, 0.5, 1e-9);
  EXPECT_NEAR(events.back().t_s, 2.0, 1e-9);
}

TEST(SensorNoise, LeakAddsToTheSlopeOfTheIntensity) {
  SensorSpec spec = exact_sensor(0.2);
  spec.leak_rate_hz = 1;  // the level falls by 0.2 a second
  constexpr ImageSize kOnePixel{1, 1};
  Sensor falling(spec, kOnePixel, CounterRandom(1));
  falling.step(log_picture(kOnePixel, -1, spec), 0);
  EXPECT_THAT(falling.step(log_picture(kOnePixel, -3, spec), 10), IsEmpty());
  Sensor rising(spec, kOnePixel, CounterRandom(1));
  rising.step(log_picture(kOnePixel, -3, spec), 0);
  // 0.1 + 0.2 log units a second against 0.2: an event each 2/3 s.
  const std::vector<Event> events = rising.step(log_picture(kOnePixel, -2, spec), 10.1);
  ASSERT_THAT(events, SizeIs(15));
  EXPECT_NEAR(events[14].t_s, 15 * 0.2 / (1 / 10.1 + 0.2), 1e-4);
}

TEST(SensorNoise, ShotNoiseHasTheSetRateWithoutMotion) {
  SensorSpec spec;
  spec.shot_noise_rate_hz = 3;
  const std::vector<Event> events = watch_still(spec, 4, 9);
  const double expected = 3.0 * 4 * static_cast<double>(kSize.pixel_count());
  EXPECT_NEAR(static_cast<double>(events.size()), expected, 4 * std::sqrt(expected));
  double positive = 0;
  for (const Event& event : events) positive += event.positive;
  EXPECT_NEAR(positive, expected / 2, 4 * std::sqrt(expected / 2));
}

TEST(SensorNoise, DoesNotDependOnHowTimeIsCut) {
  SensorSpec spec;
  spec.leak_rate_hz = 0.7;
  spec.shot_noise_rate_hz = 2;
  spec.refractory_s = 0.02;
  spec.hot_pixel_fraction = 0.05;
  spec.hot_pixel_rate_hz = 40;
  std::vector<Event> whole = watch_still(spec, 2, 1);
  std::vector<Event> cut = watch_still(spec, 2, 37);
  ASSERT_EQ(whole.size(), cut.size());
  // By pixel: leaks of many pixels coincide up to rounding.
  const auto by_pixel = [](const Event& event) { return std::tuple(event.y, event.x, event.t_s); };
  std::ranges::sort(whole, {}, by_pixel);
  std::ranges::sort(cut, {}, by_pixel);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(whole[i].x, cut[i].x);
    EXPECT_EQ(whole[i].y, cut[i].y);
    EXPECT_EQ(whole[i].positive, cut[i].positive);
    EXPECT_NEAR(whole[i].t_s, cut[i].t_s, 1e-12);
  }
}

TEST(SensorNoise, ANoiseEventSetsTheLevelAnew) {
  // Shot noise far denser than the motion: hardly a pixel gets a full threshold away between two
  // resets (0.3 log units at 0.1 a second, 50 resets a second: chance exp(-50 · 3)).
  SensorSpec noisy = exact_sensor(0.3);
  noisy.shot_noise_rate_hz = 50;
  Sensor moving(noisy, kSize, CounterRandom(1));
  Sensor still(noisy, kSize, CounterRandom(1));
  moving.step(log_picture(kSize, -3, noisy), 0);
  still.step(log_picture(kSize, -3, noisy), 0);
  const std::vector<Event> while_moving = moving.step(log_picture(kSize, -2.5, noisy), 5);
  EXPECT_EQ(while_moving, still.step(log_picture(kSize, -3, noisy), 5));
}

TEST(SensorNoise, SameSeedSameEventsOtherSeedOthers) {
  SensorSpec spec;
  spec.shot_noise_rate_hz = 2;
  spec.hot_pixel_fraction = 0.1;
  spec.hot_pixel_rate_hz = 10;
  EXPECT_EQ(watch_still(spec, 1, 3, 8), watch_still(spec, 1, 3, 8));
  EXPECT_NE(watch_still(spec, 1, 3, 8), watch_still(spec, 1, 3, 9));
}

}  // namespace
}  // namespace eventgan
