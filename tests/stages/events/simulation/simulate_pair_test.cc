#include "stages/events/simulation/simulate_pair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "stages/events/simulation/affine_motion.h"
#include "tests/stages/events/simulation/log_pictures.h"
#include "tests/stages/events/simulation/textured_picture.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::textured_picture;

TEST(SimulateInterval, AnAffinelyMovedEdgeFiresAlongItsWay) {
  // Bright (255) up to x = 7, dark (51) right of it, moved right by 4 px in 0.4 s: pixels 8..11
  // brighten one after the other, 0.1 s each, by ln(1.001/0.201) = 1.605: 5 events of 0.3.
  GreyImage picture{{2, 14}, {}};
  for (int i = 0; i < 28; ++i) picture.pixels.push_back(i % 14 <= 7 ? 255 : 51);
  const AffineInterval interval(picture, {{1, 0, 4, 0, 1, 0}});
  const SensorSpec spec = exact_sensor(0.3);
  const std::vector<Event> events = simulate_interval(interval, spec, 0.4, CounterRandom(1));
  ASSERT_THAT(events, SizeIs(4 * 5 * 2));
  const double change = std::log(1.001 / 0.201);
  for (std::size_t i = 0; i < events.size(); ++i) {
    const auto column = static_cast<int>(i) / 10;
    const auto k = static_cast<int>(i) / 2 % 5 + 1;
    EXPECT_EQ(events[i].x, 8 + column);
    EXPECT_EQ(events[i].y, static_cast<int>(i) % 2);
    EXPECT_TRUE(events[i].positive);
    EXPECT_NEAR(events[i].t_s, 0.1 * (column + 0.3 * k / change), 1e-6);
  }
}

TEST(SimulateInterval, RefusesADurationOfNothing) {
  const AffineInterval interval(textured_picture({4, 4}), {});
  EXPECT_THROW(simulate_interval(interval, {}, 0, CounterRandom(1)), std::invalid_argument);
  EXPECT_THROW(simulate_interval(interval, {}, -1, CounterRandom(1)), std::invalid_argument);
}

TEST(FeedInterval, GoesOnWhereTheIntervalBeforeEnded) {
  const SensorSpec spec = exact_sensor(0.1);
  const GreyImage picture = textured_picture({20, 30});
  const AffineInterval there(picture, {{1, 0, 3, 0, 1, 0}});
  Sensor sensor(spec, there.size(), CounterRandom(1));
  sensor.step(there.render(0), 1);
  std::vector<Event> events;
  feed_interval(sensor, there, 1, 1.3, events);
  const std::size_t first = events.size();
  ASSERT_GT(first, 0u);
  EXPECT_LE(events.back().t_s, 1.3);
  feed_interval(sensor, there, 1.3, 1.7, events);
  ASSERT_GT(events.size(), first);
  EXPECT_GT(events[first].t_s, 1.3);
  EXPECT_LE(events.back().t_s, 1.7);
}

TEST(SimulateAffine, AStillPictureGivesNoEvents) {
  EXPECT_THAT(simulate_affine(textured_picture({30, 40}), 0, SensorSpec{}, 0.1, CounterRandom(1)),
              IsEmpty());
}

TEST(SimulateAffine, IsAFunctionOfTheSeed) {
  const GreyImage picture = textured_picture({30, 40});
  const auto events = [&](std::uint64_t seed) {
    return simulate_affine(picture, 6, exact_sensor(0.1), 0.1, CounterRandom(seed));
  };
  EXPECT_THAT(events(1), ::testing::Not(IsEmpty()));
  EXPECT_EQ(events(1), events(1));
  EXPECT_NE(events(1), events(2));
  EXPECT_THROW(simulate_affine(picture, -1, {}, 0.1, CounterRandom(1)), std::invalid_argument);
}

TEST(SimulateAffine, TakesAPictureOfOnePixel) {
  EXPECT_THAT(simulate_affine({{1, 1}, {9}}, 6, SensorSpec{}, 0.1, CounterRandom(1)), IsEmpty());
}

TEST(SimulateDifference, GivesTheWholeThresholdsOfTheChange) {
  const GreyImage previous{{1, 4}, {10, 0, 255, 100}};
  const GreyImage next{{1, 4}, {200, 255, 0, 100}};
  const std::vector<Event> events =
      simulate_difference(previous, next, exact_sensor(0.2), 0.05, CounterRandom(1));
  std::vector<int> net(4);
  for (const Event& event : events)
    net[static_cast<std::size_t>(event.x)] += event.positive ? 1 : -1;
  const auto whole = [](double from, double to) {
    return static_cast<int>((std::log(to / 255 + 0.001) - std::log(from / 255 + 0.001)) / 0.2);
  };
  EXPECT_THAT(net, ::testing::ElementsAre(whole(10, 200), whole(0, 255), whole(255, 0), 0));
  EXPECT_EQ(events.size(), static_cast<std::size_t>(net[0] + net[1] - net[2]));
}

TEST(SimulateDifference, RefusesFramesOfTwoSizes) {
  EXPECT_THROW(simulate_difference({{2, 1}, {1, 2}}, {{1, 2}, {1, 2}}, {}, 1, CounterRandom(1)),
               std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
