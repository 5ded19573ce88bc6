#include "stages/events/simulation/sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "tests/stages/events/simulation/simulated_images.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using testing::intensity_at;
using ::testing::IsEmpty;
using testing::log_image;
using ::testing::SizeIs;

constexpr ImageSize kOnePixel{1, 1};

/// Float logarithms of the images are good to some 1e-7; times scale with 1 / change.
constexpr double kTolerance = 3e-6;

TEST(Sensor, SignalsEachCrossingOfALineAtItsTime) {
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  EXPECT_THAT(sensor.step(log_image(kOnePixel, -2, spec), 5), IsEmpty());
  const std::vector<Event> rise = sensor.step(log_image(kOnePixel, -1, spec), 7);
  // floor(1 / 0.3) events, each where -2 + (t - 5) / 2 is k 0.3 above -2.
  ASSERT_THAT(rise, SizeIs(3));
  for (int k = 1; k <= 3; ++k) {
    EXPECT_NEAR(rise[k - 1].t_s, 5 + 2 * 0.3 * k, kTolerance);
    EXPECT_TRUE(rise[k - 1].positive);
  }
  // The level is at -1.1; going down from -1 it is crossed by 0.3 at -1.4, -1.7, -2.0.
  const std::vector<Event> fall = sensor.step(log_image(kOnePixel, -1.95, spec), 8.9);
  ASSERT_THAT(fall, SizeIs(2));
  EXPECT_NEAR(fall[0].t_s, 7 + 2 * 0.4, kTolerance);
  EXPECT_NEAR(fall[1].t_s, 7 + 2 * 0.7, kTolerance);
  EXPECT_FALSE(fall[0].positive);
  EXPECT_FALSE(fall[1].positive);
}

TEST(Sensor, RemembersItsLevelOverManySmallSteps) {
  const SensorSpec spec = exact_sensor(0.25);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_image(kOnePixel, -3, spec), 0);
  std::vector<double> times;
  for (int step = 1; step <= 1000; ++step) {
    for (const Event& event : sensor.step(log_image(kOnePixel, -3 + 0.0021 * step, spec), step)) {
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
  sensor.step(log_image(kOnePixel, -2, spec), 0);
  EXPECT_THAT(sensor.step(log_image(kOnePixel, -1.5, spec), 1), SizeIs(2));  // level -1.6
  EXPECT_THAT(sensor.step(log_image(kOnePixel, -2.6, spec), 2), SizeIs(2));  // -2.05, -2.5
}

TEST(Sensor, SeesAMovingEdgeOfKnownContrast) {
  // A bright-to-dark edge, 1 log unit, moves right by one pixel a millisecond: pixel x darkens
  // between x and x + 1 ms, and signals floor(1 / 0.3) times.
  constexpr ImageSize kSize{3, 8};
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kSize, CounterRandom(1));
  std::vector<Event> events;
  for (int edge = 0; edge <= kSize.width; ++edge) {
    std::vector<float> image;
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        image.push_back(intensity_at(x < edge ? -1.5 : -0.5, spec));
      }
    }
    const std::vector<Event> seen = sensor.step(image, 1e-3 * edge);
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
  sensor.step(log_image(kSize, -3, spec), 0);
  std::vector<float> image = log_image(kSize, -2.55, spec);
  image[7] = intensity_at(-3.45, spec);
  image[11] = intensity_at(-1, spec);
  const std::vector<Event> events = sensor.step(image, 1);
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
  sensor.step(log_image(kSize, -2, spec), 0);
  // To 0.5 exactly: pixels whose threshold is below the mean signal, half of them.
  const std::vector<Event> events = sensor.step(log_image(kSize, -1.5, spec), 1);
  EXPECT_NEAR(static_cast<double>(events.size()), 1250, 4 * 25);
}

TEST(Sensor, StaysSilentWithoutMotionOrNoise) {
  constexpr ImageSize kSize{6, 7};
  SensorSpec spec;
  Sensor sensor(spec, kSize, CounterRandom(1));
  for (int step = 0; step < 50; ++step) {
    EXPECT_THAT(sensor.step(log_image(kSize, -1, spec), step), IsEmpty());
  }
}

/// Events of a log intensity that climbs by 1 a second from -3, shown in `steps` images a second.
std::vector<Event> climb(const SensorSpec& spec, int steps) {
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  std::vector<Event> events;
  for (int step = 0; step <= steps; ++step) {
    const double t_s = static_cast<double>(step) / steps;
    for (const Event& event : sensor.step(log_image(kOnePixel, -3 + t_s, spec), t_s)) {
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
  sensor.step(log_image(kOnePixel, -3, spec), 0);
  EXPECT_THAT(sensor.step(log_image(kOnePixel, -1, spec), 0.01), SizeIs(1));
  // From 1.0015 s on the level is -1, where the pixel was when it woke.
  EXPECT_THAT(sensor.step(log_image(kOnePixel, -1, spec), 2), IsEmpty());
  EXPECT_THAT(sensor.step(log_image(kOnePixel, -1.29, spec), 3), IsEmpty());
  const std::vector<Event> events = sensor.step(log_image(kOnePixel, -1.31, spec), 4);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_FALSE(events[0].positive);
  EXPECT_NEAR(events[0].t_s, 3.5, 1e-4);
}

TEST(SensorRefractory, WakesWithinAStep) {
  SensorSpec spec = exact_sensor(0.5);
  spec.refractory_s = 0.5;
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_image(kOnePixel, -3, spec), 0);
  ASSERT_THAT(sensor.step(log_image(kOnePixel, -2.4, spec), 0.6), SizeIs(1));  // at 0.5
  // Wakes at 1.0 with the level on the line from (0.6, -2.4) to (2.6, -0.4), at -2: next at -1.5.
  const std::vector<Event> events = sensor.step(log_image(kOnePixel, -0.4, spec), 2.6);
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
  const double black = std::log(spec.log_epsilon);  // where shot noise has its whole rate
  sensor.step(log_image(kSize, black, spec), 0);
  const std::vector<Event> events = sensor.step(log_image(kSize, black, spec), 10);
  // A renewal process with mean wait R + 1/r and variance 1/r^2: T / (R + 1/r) events a pixel, on
  // average (1/r^2 / mean^2 - 1)/2 + ... below 1 off that, of variance T / (r^2 mean^3). Over the
  // pixels' own rates the mean is 92, and the deviation, most of it between pixels, below 30.
  double sum = 0, weights = 0;
  for (double z = -6; z <= 6; z += 0.01) {
    const double rate =
        20 * std::exp(kNoiseRateSpread * z - kNoiseRateSpread * kNoiseRateSpread / 2);
    sum += std::exp(-z * z / 2) * 10 / (0.05 + 1 / rate);
    weights += std::exp(-z * z / 2);
  }
  const double pixels = 1600;
  EXPECT_NEAR(static_cast<double>(events.size()), sum / weights * pixels,
              pixels + 4 * 30 * std::sqrt(pixels));
  std::vector<double> last(kSize.pixel_count(), -1);
  for (const Event& event : events) {
    double& before = last[static_cast<std::size_t>(event.y * kSize.width + event.x)];
    EXPECT_GE(event.t_s - before, 0.05 - 1e-12);
    before = event.t_s;
  }
}

constexpr ImageSize kPushedSize{3, 5};

TEST(SensorExtremes, BlackToWhiteAndBackIsFinite) {
  const SensorSpec spec = exact_sensor(0.01);
  Sensor sensor(spec, kPushedSize, CounterRandom(1));
  sensor.step(std::vector<float>(15, 0.0f), 0);
  const std::vector<Event> up = sensor.step(std::vector<float>(15, 1.0f), 1);
  const auto crossings = static_cast<std::size_t>(std::log(1.001 / 0.001) / 0.01);  // 690.9
  EXPECT_EQ(up.size(), 15 * crossings);
  EXPECT_TRUE(std::ranges::all_of(up, [](const Event& e) { return e.t_s > 0 && e.t_s <= 1; }));
  // The level is 0.9 of a threshold below white, so as many come back, less or more one.
  const std::vector<Event> down = sensor.step(std::vector<float>(15, 0.0f), 2);
  EXPECT_NEAR(static_cast<double>(down.size()), static_cast<double>(up.size()), 15);
}

TEST(SensorExtremes, EventsThatDoNotFitIntoMemoryAreRefusedWithTheSettings) {
  SensorSpec spec;
  check_events_fit(spec, {1000, 1000}, 1e6, 1);  // at rest it is silent
  spec.shot_noise_rate_hz = 1e6;
  // 15 pixels, 10 s: 1.5e8 events.
  const double bytes = idle_event_bytes(spec, 15, 10);
  EXPECT_DOUBLE_EQ(bytes, 1.5e8 * 2 * sizeof(Event));
  check_events_fit(spec, kPushedSize, 10, static_cast<std::size_t>(bytes));
  EXPECT_THROWS(check_events_fit(spec, kPushedSize, 10, 1000), std::runtime_error,
                "(1e+03 bytes), got about 1.5e+08 events",
                "5x3 pixels in 10 s: shot_noise_rate_hz 1e+06");
  // A pixel that is held for a millisecond after each event gives 1000 a second at most.
  spec.refractory_s = 1e-3;
  EXPECT_NEAR(idle_event_bytes(spec, 15, 10), 15 * 10 * 1000 * 2 * sizeof(Event), 2e4);
  // The bound is one of what really comes.
  spec = {};
  spec.shot_noise_rate_hz = 20;
  constexpr ImageSize kMany{50, 60};
  Sensor sensor(spec, kMany, CounterRandom(1));
  sensor.step(std::vector<float>(3000, 0.0f), 0);
  const std::size_t count = sensor.step(std::vector<float>(3000, 0.0f), 1).size();
  // The pixels' own rates deviate by 0.64 of their mean.
  EXPECT_NEAR(static_cast<double>(count), 60000,
              5 * std::sqrt(60000 + 3000 * std::pow(0.64 * 20, 2)));
}

TEST(SensorExtremes, BlackAndSaturatedImagesStaySilentAndTinyStepsEnd) {
  for (const float value : {0.0f, 1.0f, std::numeric_limits<float>::max()}) {
    Sensor sensor(SensorSpec{}, kPushedSize, CounterRandom(1));
    sensor.step(std::vector<float>(15, value), 0);
    EXPECT_THAT(sensor.step(std::vector<float>(15, value), 1), IsEmpty());
  }
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_image(kOnePixel, -3, spec), 0);
  const double smallest = std::numeric_limits<double>::denorm_min();
  const std::vector<Event> events = sensor.step(log_image(kOnePixel, -2, spec), smallest);
  ASSERT_THAT(events, SizeIs(3));
  for (const Event& event : events) EXPECT_EQ(event.t_s, smallest);
}

TEST(SensorExtremes, LateTimesCostNoEvents) {
  // Seconds since 1970: doubles are 2.4e-7 s apart there.
  constexpr double kNow = 1.7e9;
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_image(kOnePixel, -3, spec), kNow);
  double before = kNow;
  for (int step = 1; step <= 4; ++step) {
    const double t_s = kNow + 1e-6 * step;
    const std::vector<Event> events =
        sensor.step(log_image(kOnePixel, -3 + 0.95 * step, spec), t_s);
    EXPECT_THAT(events, SizeIs(3));  // 3.2, 6.3, 9.5, 12.7 thresholds in all
    for (const Event& event : events) EXPECT_TRUE(event.t_s > before && event.t_s <= t_s);
    before = t_s;
  }
}

TEST(SensorExtremes, RefusesWhatIsNoImageAndGoesOnUnchanged) {
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_image(kOnePixel, -3, spec), 1);
  const std::vector<float> bright = log_image(kOnePixel, -2, spec);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_THROWS(sensor.step(bright, 1), std::invalid_argument,
                "expected a time after 1.000000 s, got 1.000000 s");
  EXPECT_THROWS(sensor.step(bright, 0.5), std::invalid_argument,
                "expected a time after 1.000000 s, got 0.500000 s");
  EXPECT_THROWS(sensor.step(bright, std::nan("")), std::invalid_argument,
                "expected a time after 1.000000 s, got nan s");
  EXPECT_THROWS(sensor.step(bright, kInfinity), std::invalid_argument,
                "expected a time after 1.000000 s, got inf s");
  EXPECT_THROWS(sensor.step(std::vector<float>(2, 0.5f), 2), std::invalid_argument,
                "expected 1 intensities, got 2");
  EXPECT_THROWS(sensor.step(std::vector<float>{}, 2), std::invalid_argument,
                "expected 1 intensities, got 0");
  for (const float value : {-0.1f, kInfinity, std::nanf("")}) {
    EXPECT_THROWS(sensor.step(std::vector<float>(1, value), 2), std::invalid_argument,
                  "expected intensities >= 0");
  }
  const std::vector<Event> events = sensor.step(bright, 2);
  ASSERT_THAT(events, SizeIs(3));
  EXPECT_NEAR(events[0].t_s, 1.3, 1e-5);
}

}  // namespace
}  // namespace eventgan
