#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "stages/events/simulation/sensor.h"
#include "tests/stages/events/simulation/log_pictures.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using ::testing::IsEmpty;
using testing::log_picture;
using ::testing::SizeIs;

constexpr ImageSize kOnePixel{1, 1};
constexpr ImageSize kSize{3, 5};

TEST(SensorExtremes, BlackToWhiteAndBackIsFinite) {
  const SensorSpec spec = exact_sensor(0.01);
  Sensor sensor(spec, kSize, CounterRandom(1));
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
  check_events_fit(spec, kSize, 10, static_cast<std::size_t>(bytes));
  EXPECT_THAT([&] { check_events_fit(spec, kSize, 10, 1000); },
              ::testing::ThrowsMessage<std::runtime_error>(::testing::AllOf(
                  ::testing::HasSubstr("(1e+03 bytes), got about 1.5e+08 events"),
                  ::testing::HasSubstr("5x3 pixels in 10 s: shot_noise_rate_hz 1e+06"))));
  // A pixel that is held for a millisecond after each event gives 1000 a second at most.
  spec.refractory_s = 1e-3;
  EXPECT_NEAR(idle_event_bytes(spec, 15, 10), 15 * 10 * 1000 * 2 * sizeof(Event), 2e4);
  // The bound is one of what really comes.
  spec = {};
  spec.shot_noise_rate_hz = 200;
  Sensor sensor(spec, kSize, CounterRandom(1));
  sensor.step(std::vector<float>(15, 0.5f), 0);
  EXPECT_NEAR(static_cast<double>(sensor.step(std::vector<float>(15, 0.5f), 10).size()), 30000,
              5 * std::sqrt(30000));
}

TEST(SensorExtremes, BlackAndSaturatedPicturesStaySilent) {
  for (const float value : {0.0f, 1.0f, std::numeric_limits<float>::max()}) {
    Sensor sensor(SensorSpec{}, kSize, CounterRandom(1));
    sensor.step(std::vector<float>(15, value), 0);
    EXPECT_THAT(sensor.step(std::vector<float>(15, value), 1), IsEmpty());
  }
}

TEST(SensorExtremes, TinyStepsEnd) {
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -3, spec), 0);
  const double smallest = std::numeric_limits<double>::denorm_min();
  const std::vector<Event> events = sensor.step(log_picture(kOnePixel, -2, spec), smallest);
  ASSERT_THAT(events, SizeIs(3));
  for (const Event& event : events) EXPECT_EQ(event.t_s, smallest);
}

TEST(SensorExtremes, LateTimesCostNoEvents) {
  // Seconds since 1970: doubles are 2.4e-7 s apart there.
  constexpr double kNow = 1.7e9;
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -3, spec), kNow);
  double before = kNow;
  for (int step = 1; step <= 4; ++step) {
    const double t_s = kNow + 1e-6 * step;
    const std::vector<Event> events =
        sensor.step(log_picture(kOnePixel, -3 + 0.95 * step, spec), t_s);
    EXPECT_THAT(events, SizeIs(3));  // 3.2, 6.3, 9.5, 12.7 thresholds in all
    for (const Event& event : events) EXPECT_TRUE(event.t_s > before && event.t_s <= t_s);
    before = t_s;
  }
}

TEST(SensorExtremes, RefusesWhatIsNoPictureAndGoesOnUnchanged) {
  const SensorSpec spec = exact_sensor(0.3);
  Sensor sensor(spec, kOnePixel, CounterRandom(1));
  sensor.step(log_picture(kOnePixel, -3, spec), 1);
  const std::vector<float> bright = log_picture(kOnePixel, -2, spec);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_THROW(sensor.step(bright, 1), std::invalid_argument);
  EXPECT_THROW(sensor.step(bright, 0.5), std::invalid_argument);
  EXPECT_THROW(sensor.step(bright, std::nan("")), std::invalid_argument);
  EXPECT_THROW(sensor.step(bright, kInfinity), std::invalid_argument);
  EXPECT_THROW(sensor.step(std::vector<float>(2, 0.5f), 2), std::invalid_argument);
  EXPECT_THROW(sensor.step(std::vector<float>{}, 2), std::invalid_argument);
  for (const float value : {-0.1f, kInfinity, std::nanf("")}) {
    EXPECT_THROW(sensor.step(std::vector<float>(1, value), 2), std::invalid_argument);
  }
  const std::vector<Event> events = sensor.step(bright, 2);
  ASSERT_THAT(events, SizeIs(3));
  EXPECT_NEAR(events[0].t_s, 1.3, 1e-5);
}

}  // namespace
}  // namespace eventgan
