#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "stages/events/simulation/sensor.h"
#include "tests/stages/events/simulation/log_pictures.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using ::testing::IsEmpty;
using testing::log_picture;
using ::testing::SizeIs;

constexpr ImageSize kOnePixel{1, 1};

/// Events of a log intensity that climbs by 1 a second from -3, shown in `steps` pictures a second.
std::vector<Event> climb(const SensorSpec& spec, int steps) {
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  std::vector<Event> events;
  for (int step = 0; step <= steps; ++step) {
    const double t_s = static_cast<double>(step) / steps;
    for (const Event& event : sensor.step(log_picture(kOnePixel, -3 + t_s, spec), t_s)) {
      events.push_back(event);
    }
  }
  return events;
}

TEST(SensorRefractory, AClimbSignalsEachThresholdPlusRefractoryTime) {
  SensorSpec spec = exact_sensor(0.1);
  spec.refractory_s = 0.06;
  // Held in reset for 0.06 s after each event, then 0.1 s to the next threshold; however cut.
  for (const int steps : {1, 7, 100}) {
    const std::vector<Event> events = climb(spec, steps);
    ASSERT_THAT(events, SizeIs(6)) << steps;
    for (int k = 0; k < 6; ++k) EXPECT_NEAR(events[k].t_s, 0.1 + 0.16 * k, 1e-4) << steps;
  }
}

TEST(SensorRefractory, WhatIsPassedMeanwhileIsLost) {
  SensorSpec spec = exact_sensor(0.3);
  spec.refractory_s = 1;
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -3, spec), 0);
  EXPECT_THAT(sensor.step(log_picture(kOnePixel, -1, spec), 0.01), SizeIs(1));
  // From 1.0015 s on the level is -1, where the pixel was when it woke.
  EXPECT_THAT(sensor.step(log_picture(kOnePixel, -1, spec), 2), IsEmpty());
  EXPECT_THAT(sensor.step(log_picture(kOnePixel, -1.29, spec), 3), IsEmpty());
  const std::vector<Event> events = sensor.step(log_picture(kOnePixel, -1.31, spec), 4);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_FALSE(events[0].positive);
  EXPECT_NEAR(events[0].t_s, 3.5, 1e-4);
}

TEST(SensorRefractory, WakesWithinAStep) {
  SensorSpec spec = exact_sensor(0.5);
  spec.refractory_s = 0.5;
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -3, spec), 0);
  ASSERT_THAT(sensor.step(log_picture(kOnePixel, -2.4, spec), 0.6), SizeIs(1));  // at 0.5
  // Wakes at 1.0 with the level on the line from (0.6, -2.4) to (2.6, -0.4), at -2: next at -1.5.
  const std::vector<Event> events = sensor.step(log_picture(kOnePixel, -0.4, spec), 2.6);
  ASSERT_THAT(events, SizeIs(2));
  EXPECT_NEAR(events[0].t_s, 1.5, 1e-5);
  EXPECT_NEAR(events[1].t_s, 2.5, 1e-5);  // woke at 2.0 and -1
}

TEST(SensorRefractory, DeadTimeLowersTheRateOfNoise) {
  constexpr ImageSize kSize{40, 40};
  SensorSpec spec = exact_sensor(0.2);
  spec.shot_noise_rate_hz = 20;
  spec.refractory_s = 0.05;
  Sensor sensor(spec, kSize, CounterRandom(3));
  sensor.step(log_picture(kSize, -1, spec), 0);
  const std::vector<Event> events = sensor.step(log_picture(kSize, -1, spec), 10);
  // A renewal process with mean wait R + 1/r = 0.1 s and variance 1/r^2: 100 events a pixel of
  // variance T / (r^2 mean^3) = 25, and on average (1/r^2 / mean^2 - 1)/2 + ... below 1 off that.
  const double pixels = 1600;
  EXPECT_NEAR(static_cast<double>(events.size()), 100 * pixels, pixels + 4 * 5 * std::sqrt(pixels));
  std::vector<double> last(kSize.pixel_count(), -1);
  for (const Event& event : events) {
    double& before = last[static_cast<std::size_t>(event.y * kSize.width + event.x)];
    EXPECT_GE(event.t_s - before, 0.05 - 1e-12);
    before = event.t_s;
  }
}

}  // namespace
}  // namespace eventgan
