// The volume of a pair, made pixel by pixel, against that of the sensor's events in time order.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/values/gaussian_random.h"
#include "stages/events/event_volume.h"
#include "stages/events/simulation/affine_motion.h"
#include "stages/events/simulation/sensor.h"
#include "stages/events/simulation/simulate_pair.h"
#include "tests/stages/events/simulation/simulated_images.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::textured_image;

constexpr double kDurationS = 0.1;

GreyImage random_image(ImageSize size, std::mt19937& random) {
  GreyImage image{size, std::vector<std::uint8_t>(size.pixel_count())};
  for (std::uint8_t& value : image.pixels) value = static_cast<std::uint8_t>(random());
  return image;
}

/// The image with some values a little higher or lower.
GreyImage nudged(GreyImage image, std::mt19937& random) {
  for (std::uint8_t& value : image.pixels) {
    const int moved = value + static_cast<int>(random() % 61) - 30;
    value = static_cast<std::uint8_t>(std::clamp(moved, 0, 255));
  }
  return image;
}

std::vector<float> pixel_volume(std::span<const Event> events, const VolumeShape& shape) {
  std::vector<float> volume(shape.value_count(), -1.0f);
  pixel_event_volume(events, shape, volume);
  return volume;
}

/// What two images of a Sensor give.
std::vector<Event> difference_events(const GreyImage& previous, const GreyImage& next,
                                     const SensorSpec& spec, double duration_s,
                                     CounterRandom random) {
  Sensor sensor(spec, previous.size, random);
  sensor.step(linear_intensity(previous), 0);
  return sensor.step(linear_intensity(next), duration_s);
}

std::vector<Event> affine_events(const GreyImage& image, double max_displacement_px,
                                 const SensorSpec& spec, double duration_s, CounterRandom random) {
  const double displacement_px = max_displacement_px * random.keyed("displacement").uniform(0);
  const AffineMotion motion =
      random_affine_motion(image.size, displacement_px, random.keyed("motion"));
  const int steps = AffineInterval(image, motion).steps();
  Sensor sensor(spec, image.size, random.keyed("sensor"));
  std::vector<Event> events;
  for (int step = 0; step <= steps; ++step) {
    const double part = static_cast<double>(step) / steps;
    const std::vector<Event> seen =
        sensor.step(render_affine(image, motion, part), duration_s * part);
    events.insert(events.end(), seen.begin(), seen.end());
  }
  return events;
}

void expect_same(const std::vector<Event>& expected, const std::vector<Event>& by_pixel,
                 ImageSize size) {
  std::vector<Event> by_time = by_pixel;
  std::ranges::sort(by_time, comes_before);
  ASSERT_EQ(by_time, expected);
  for (const int bins : {1, 2, 9, 64}) {
    const VolumeShape shape{bins, size};
    ASSERT_EQ(pixel_volume(by_pixel, shape), event_volume(expected, shape)) << bins << " bins";
  }
}

void expect_same_pair(const GreyImage& previous, const GreyImage& next, const SensorSpec& spec,
                      double duration_s, std::uint64_t seed) {
  const CounterRandom random(seed);
  expect_same(difference_events(previous, next, spec, duration_s, random),
              simulate_difference(previous, next, spec, duration_s, random), previous.size);
  constexpr double kDisplacementPx = 4;
  expect_same(affine_events(previous, kDisplacementPx, spec, duration_s, random),
              simulate_affine(previous, kDisplacementPx, spec, duration_s, random), previous.size);
}

struct NamedSensor {
  std::string name;
  SensorSpec spec;
};

std::vector<NamedSensor> sensors() {
  std::vector<NamedSensor> all = {{"defaults", {}}};
  const auto add = [&](const std::string& name, auto&& change) {
    SensorSpec spec;
    change(spec);
    all.push_back({name, spec});
  };
  add("one threshold", [](SensorSpec& spec) { spec.threshold_spread = 0; });
  add("every threshold", [](SensorSpec& spec) { spec.threshold_spread = 1; });
  add("lowest", [](SensorSpec& spec) {
    spec.positive_threshold = spec.negative_threshold = 0.01;
    spec.threshold_spread = 0;
  });
  add("high", [](SensorSpec& spec) {
    spec.positive_threshold = 1;
    spec.negative_threshold = 2;
    spec.threshold_spread = 0.3;
  });
  add("epsilon", [](SensorSpec& spec) { spec.log_epsilon = 1e-6; });
  add("refractory", [](SensorSpec& spec) { spec.refractory_s = 0.013; });
  add("long refractory", [](SensorSpec& spec) { spec.refractory_s = 1; });
  add("leak", [](SensorSpec& spec) { spec.leak_rate_hz = 7; });
  add("shot", [](SensorSpec& spec) { spec.shot_noise_rate_hz = 15; });
  add("hot", [](SensorSpec& spec) {
    spec.hot_pixel_fraction = 0.3;
    spec.hot_pixel_rate_hz = 40;
  });
  add("cold", [](SensorSpec& spec) { spec.hot_pixel_fraction = 0.3; });
  add("all", [](SensorSpec& spec) {
    spec.refractory_s = 0.01;
    spec.leak_rate_hz = 5;
    spec.shot_noise_rate_hz = 10;
    spec.hot_pixel_fraction = 0.1;
    spec.hot_pixel_rate_hz = 100;
  });
  return all;
}

class PairVolume : public ::testing::TestWithParam<NamedSensor> {};

TEST_P(PairVolume, IsThatOfTheSensorsEvents) {
  std::mt19937 random(5);
  std::uint64_t seed = 0;
  for (const ImageSize size :
       {ImageSize{1, 1}, ImageSize{1, 7}, ImageSize{13, 1}, ImageSize{17, 29}}) {
    for (int i = 0; i < 4; ++i) {
      const GreyImage previous = random_image(size, random);
      expect_same_pair(previous, random_image(size, random), GetParam().spec, kDurationS, ++seed);
      expect_same_pair(previous, nudged(previous, random), GetParam().spec, kDurationS, ++seed);
    }
  }
}

TEST_P(PairVolume, IsTheSameOfExtremes) {
  constexpr ImageSize kSize{5, 9};
  const auto flat = [size = kSize](std::uint8_t value) {
    return GreyImage{size, std::vector<std::uint8_t>(size.pixel_count(), value)};
  };
  const SensorSpec& spec = GetParam().spec;
  expect_same_pair(flat(0), flat(255), spec, kDurationS, 1);
  expect_same_pair(flat(255), flat(0), spec, kDurationS, 2);
  expect_same_pair(flat(77), flat(77), spec, kDurationS, 3);
  for (const double duration_s : {1e-300, 1e-9, 3.0}) {
    expect_same_pair(textured_image(kSize), textured_image(kSize, 3, 1), spec, duration_s, 4);
  }
}

INSTANTIATE_TEST_SUITE_P(Sensors, PairVolume, ::testing::ValuesIn(sensors()),
                         [](const auto& sensor) {
                           std::string name = sensor.param.name;
                           std::ranges::replace(name, ' ', '_');
                           return name;
                         });

TEST(PairVolume, IsTheSameOfAWholeFrameAndNotOfNothing) {
  constexpr ImageSize kSize{130, 431};
  expect_same_pair(textured_image(kSize), textured_image(kSize, 4, 1), {}, 0.1, 9);
  const GreyImage image = textured_image({4, 4});
  for (const double duration_s : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THROWS(simulate_difference(image, image, {}, duration_s, CounterRandom(1)),
                  std::invalid_argument, "expected a time after");
    EXPECT_THROWS(simulate_affine(image, 3, {}, duration_s, CounterRandom(1)),
                  std::invalid_argument, "expected a time after");
  }
  EXPECT_THROWS(simulate_affine(image, 0, {}, 1e308 * 10, CounterRandom(1)), std::invalid_argument,
                "expected a time after");
}

TEST(PixelEventVolume, RefusesEventsOutsideOrOutOfOrder) {
  const std::string time = "expected an event with a finite time inside 5x4 pixels, got ",
                    order = "expected events pixel by pixel, each pixel's in time order, got ";
  const std::pair<std::vector<Event>, std::string> cases[] = {
      {{{.x = 5, .y = 0, .t_s = 0}}, time + "x=5 y=0"},
      {{{.x = 0, .y = 0, .t_s = std::nan("")}}, time + "x=0 y=0 t=nan"},
      {{{.x = 0, .y = 1, .t_s = 0}, {.x = 0, .y = 0, .t_s = 1}}, order + "x=0 y=0"},
      {{{.x = 1, .y = 1, .t_s = 0}, {.x = 0, .y = 1, .t_s = 1}}, order + "x=0 y=1"},
      {{{.x = 1, .y = 1, .t_s = 1}, {.x = 1, .y = 1, .t_s = 0}}, order + "x=1 y=1"},
      {{{.x = 1, .y = 1, .t_s = -1e308}, {.x = 1, .y = 1, .t_s = 1e308}},
       "expected times whose differences are finite"}};
  for (const auto& [events, words] : cases) {
    EXPECT_THROWS(pixel_volume(events, {3, {4, 5}}), std::invalid_argument, words);
  }
}

TEST(PixelEventVolume, TakesTheEarliestAndTheLatestTimeOfAll) {
  // t* of 2 is (3 - 1) (2 - 1)/(5 - 1) = 0.5.
  const VolumeShape shape{3, {1, 3}};
  const std::vector<float> volume = pixel_volume({{{.x = 0, .y = 0, .t_s = 2},
                                                   {.x = 1, .y = 0, .t_s = 5},
                                                   {.x = 2, .y = 0, .t_s = 1, .positive = false}}},
                                                 shape);
  EXPECT_THAT(volume, ::testing::ElementsAre(0.5f, 0, 0, 0.5f, 0, 0, 0, 1, 0,  //
                                             0, 0, 1, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(pixel_volume({}, shape), ::testing::Each(0.0f));
}

TEST(DrawThresholds, AreOfTheGaussianToTheLastBit) {
  for (const double spread : {1e-6, 0.03, 1.0}) {
    const CounterRandom random(3);
    const std::vector<float> drawn = draw_thresholds(0.2, spread, 100'000, random);
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const auto exact = static_cast<float>(0.2 + spread * gaussian(random, i));
      ASSERT_EQ(drawn[i], std::max(exact, kSmallestThreshold)) << spread << " " << i;
    }
  }
}

}  // namespace
}  // namespace eventgan
