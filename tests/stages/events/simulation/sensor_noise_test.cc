#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/events/simulation/sensor.h"
#include "tests/stages/events/simulation/simulated_images.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using ::testing::IsEmpty;
using testing::log_image;
using ::testing::SizeIs;

constexpr std::size_t kManyPixels = 20000;

TEST(PixelThresholds, AreGaussian) {
  const std::vector<float> drawn = draw_thresholds(0.5, 0.05, kManyPixels, CounterRandom(7));
  const double n = kManyPixels;
  const double mean = std::accumulate(drawn.begin(), drawn.end(), 0.0) / n;
  double squares = 0;
  for (const float value : drawn) squares += (value - mean) * (value - mean);
  const double deviation = std::sqrt(squares / n);
  // Four standard errors each: sigma / sqrt(n), sigma / sqrt(2 n), sqrt(p (1 - p) / n).
  EXPECT_NEAR(mean, 0.5, 4 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(deviation, 0.05, 4 * 0.05 / std::sqrt(2 * n));
  const auto within = [&](double sigmas) {
    return static_cast<double>(std::ranges::count_if(
               drawn, [&](float value) { return std::abs(value - 0.5) < sigmas * 0.05; })) /
           n;
  };
  EXPECT_NEAR(within(1), 0.6827, 4 * std::sqrt(0.6827 * 0.3173 / n));
  EXPECT_NEAR(within(2), 0.9545, 4 * std::sqrt(0.9545 * 0.0455 / n));
}

TEST(PixelThresholds, AreTheMeanWithoutSpreadAndNeverBelowTheSmallest) {
  EXPECT_THAT(draw_thresholds(0.3, 0, 5, CounterRandom(1)), ::testing::Each(0.3f));
  const std::vector<float> drawn = draw_thresholds(0.02, 1, kManyPixels, CounterRandom(7));
  EXPECT_EQ(*std::ranges::min_element(drawn), kSmallestThreshold);
  // Half of a Gaussian of spread 1 about 0.02 lies below 0.01, to within 0.01/sqrt(2 pi).
  const auto lowest = std::ranges::count(drawn, kSmallestThreshold);
  EXPECT_NEAR(static_cast<double>(lowest) / kManyPixels, 0.496,
              4 * 0.5 / std::sqrt(double{kManyPixels}));
  EXPECT_EQ(draw_thresholds(0.2, 0.03, 50, CounterRandom(3)),
            draw_thresholds(0.2, 0.03, 50, CounterRandom(3)));
  EXPECT_NE(draw_thresholds(0.2, 0.03, 50, CounterRandom(3)),
            draw_thresholds(0.2, 0.03, 50, CounterRandom(4)));
  EXPECT_TRUE(draw_thresholds(0.2, 0.03, 0, CounterRandom(3)).empty());
}

struct ArrivalCounts {
  std::vector<int> positive;
  std::vector<int> negative;
};

ArrivalCounts count_until(PixelNoise& noise, std::size_t pixels, double end_s, double light = 0) {
  ArrivalCounts counts{std::vector<int>(pixels), std::vector<int>(pixels)};
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    while (noise.next_s(pixel) <= end_s) {
      const std::optional<bool> positive = noise.take(pixel, light);
      if (positive) ++(*positive ? counts.positive : counts.negative)[pixel];
    }
  }
  return counts;
}

// Of log-normal rates r with a factor of 1.8: E[r] is the set rate, Var[r] = E[r]² (exp(ln²1.8) -
// 1), which adds to that of a Poisson count.
constexpr double kRateVariance = 0.41272;  // exp(0.5878²) - 1

TEST(PixelNoise, ShotNoiseHasTheSetRateOnAverageAndIsBalanced) {
  constexpr std::size_t kPixels = 16384;
  SensorSpec spec;
  spec.shot_noise_rate_hz = 2;
  PixelNoise noise(spec, kPixels, 100, CounterRandom(5));
  const ArrivalCounts counts = count_until(noise, kPixels, 105);
  const double expected = 2 * 5;  // a pixel
  double sum = 0;
  double squares = 0;
  double positive = 0;
  for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
    const double count = counts.positive[pixel] + counts.negative[pixel];
    sum += count;
    squares += (count - expected) * (count - expected);
    positive += counts.positive[pixel];
  }
  // Four standard deviations of the total and of a fair coin's count; the variance has long tails.
  const double variance = expected + expected * expected * kRateVariance;
  EXPECT_NEAR(sum, expected * kPixels, 4 * std::sqrt(variance * kPixels));
  EXPECT_NEAR(squares / kPixels / variance, 1, 0.15);
  EXPECT_NEAR(positive, sum / 2, 4 * std::sqrt(sum) / 2);
}

// v2e's rule: a quarter at white, on a line of the intensity; what is brighter is white.
TEST(PixelNoise, LightTakesShotNoiseOfBothPolaritiesButNotThatOfHotPixels) {
  constexpr std::size_t kPixels = 4096;
  SensorSpec spec;
  spec.shot_noise_rate_hz = 5;
  const auto sums = [&](double light) {
    PixelNoise noise(spec, kPixels, 0, CounterRandom(5));
    const ArrivalCounts counts = count_until(noise, kPixels, 4, light);
    return std::array{std::accumulate(counts.positive.begin(), counts.positive.end(), 0.0),
                      std::accumulate(counts.negative.begin(), counts.negative.end(), 0.0)};
  };
  const auto dark = sums(0);
  EXPECT_EQ(sums(-0.1), dark);
  for (const auto& [light, share] : {std::pair(0.4, 0.7), {1.0, 0.25}, {7.0, 0.25}}) {
    const auto lit = sums(light);
    for (std::size_t k = 0; k < 2; ++k) {  // of a known number of arrivals, so binomial
      EXPECT_NEAR(lit[k], share * dark[k], 5 * std::sqrt(dark[k]));
    }
  }
  spec = {};
  spec.hot_pixel_fraction = 1;
  spec.hot_pixel_rate_hz = 9;
  EXPECT_EQ(sums(1), sums(0));
}

TEST(PixelNoise, HotPixelsFireInOnePolarityAtTheirRate) {
  constexpr std::size_t kPixels = 2000;
  SensorSpec spec;
  spec.hot_pixel_fraction = 0.1;
  spec.hot_pixel_rate_hz = 100;
  PixelNoise noise(spec, kPixels, 0, CounterRandom(6));
  const ArrivalCounts counts = count_until(noise, kPixels, 1);
  int hot = 0;
  int hot_positive = 0;
  double sum = 0;
  for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
    EXPECT_TRUE(counts.positive[pixel] == 0 || counts.negative[pixel] == 0);
    hot += counts.positive[pixel] + counts.negative[pixel] > 0;
    hot_positive += counts.positive[pixel] > 0;
    sum += counts.positive[pixel] + counts.negative[pixel];
  }
  EXPECT_NEAR(hot, 200, 4 * std::sqrt(2000 * 0.1 * 0.9));
  EXPECT_NEAR(hot_positive, hot / 2.0, 4 * std::sqrt(hot) / 2);
  EXPECT_NEAR(sum, 100.0 * hot, 4 * std::sqrt(100.0 * hot));
}

TEST(PixelNoise, IsSilentAtRateZero) {
  SensorSpec spec;
  spec.hot_pixel_fraction = 1;
  const PixelNoise noise(spec, 3, 0, CounterRandom(1));
  for (std::size_t pixel = 0; pixel < 3; ++pixel) {
    EXPECT_EQ(noise.next_s(pixel), std::numeric_limits<double>::infinity());
  }
}

TEST(PixelNoise, ArrivalsRise) {
  SensorSpec spec;
  spec.shot_noise_rate_hz = 1e6;
  PixelNoise noise(spec, 1, 10, CounterRandom(1));
  double last_s = 10;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_GE(noise.next_s(0), last_s);
    last_s = noise.next_s(0);
    noise.take(0, 0);
  }
}

constexpr ImageSize kNoisySize{30, 40};

/// Events of an image that stays as it is for `duration_s`, shown in `steps` steps from t = 0.
std::vector<Event> watch_still(const SensorSpec& spec, double duration_s, int steps,
                               std::uint64_t seed = 1) {
  Sensor sensor(spec, kNoisySize, CounterRandom(seed));
  std::vector<Event> events;
  for (int step = 0; step <= steps; ++step) {
    for (const Event& event :
         sensor.step(log_image(kNoisySize, -1, spec), duration_s * step / steps)) {
      events.push_back(event);
    }
  }
  return events;
}

/// Its events' times by pixel.
std::vector<std::vector<double>> times_by_pixel(const std::vector<Event>& events) {
  std::vector<std::vector<double>> times(kNoisySize.pixel_count());
  for (const Event& event : events) {
    times[static_cast<std::size_t>(event.y * kNoisySize.width + event.x)].push_back(event.t_s);
  }
  return times;
}

// Each pixel at a pace of its own, from a phase of its own: never all at one time.
TEST(SensorNoise, LeakGivesPositiveEventsAtItsRateOnAverageWhateverTheThreshold) {
  SensorSpec spec;
  spec.threshold_spread = 0.03;
  spec.leak_rate_hz = 2;
  for (const int steps : {1, 13}) {
    const std::vector<Event> events = watch_still(spec, 3.2, steps);
    const auto pixels = static_cast<double>(kNoisySize.pixel_count());
    const double expected = 2 * 3.2;
    EXPECT_NEAR(static_cast<double>(events.size()), expected * pixels,
                4 * std::sqrt((expected * expected * kRateVariance + 0.25) * pixels));
    EXPECT_TRUE(std::ranges::all_of(events, &Event::positive));
    // Spread over time: in each tenth of it as many.
    for (int tenth = 0; tenth < 10; ++tenth) {
      const auto count = std::ranges::count_if(
          events, [&](const Event& event) { return static_cast<int>(event.t_s / 0.32) == tenth; });
      EXPECT_NEAR(static_cast<double>(count), static_cast<double>(events.size()) / 10,
                  0.01 * static_cast<double>(events.size()));
    }
    double sum = 0, squares = 0, known = 0;  // of the logarithm of a pixel's pace
    for (const std::vector<double>& times : times_by_pixel(events)) {
      if (times.size() < 3) continue;
      const double pace_s = times[1] - times[0];
      for (std::size_t i = 1; i < times.size(); ++i) {
        EXPECT_NEAR(times[i] - times[i - 1], pace_s, 1e-5);
      }
      ++known;
      sum += std::log(pace_s);
      squares += std::log(pace_s) * std::log(pace_s);
    }
    // Without the slowest, which have fewer than three.
    EXPECT_NEAR(std::sqrt(squares / known - sum / known * sum / known), 0.5, 0.06);
  }
}

// A short look sees as many a second as a long one: some pixels are near an event when it begins.
TEST(SensorNoise, LeakOfAPairHasItsRate) {
  SensorSpec spec;
  spec.leak_rate_hz = 9.5;
  const std::vector<Event> events = watch_still(spec, 0.1, 1);
  const auto pixels = static_cast<double>(kNoisySize.pixel_count());
  EXPECT_NEAR(static_cast<double>(events.size()) / pixels, 0.95, 0.08);
}

TEST(SensorNoise, LeakPausesInTheRefractoryTime) {
  SensorSpec spec;
  spec.leak_rate_hz = 2;
  spec.refractory_s = 0.25;
  const auto paused = times_by_pixel(watch_still(spec, 4, 4));
  spec.refractory_s = 0;
  const auto free = times_by_pixel(watch_still(spec, 4, 4));
  for (std::size_t pixel = 0; pixel < paused.size(); ++pixel) {
    ASSERT_EQ(paused[pixel].empty(), free[pixel].empty());
    for (std::size_t i = 0; i < paused[pixel].size(); ++i) {
      EXPECT_NEAR(paused[pixel][i], free[pixel][i] + 0.25 * static_cast<double>(i), 1e-9);
    }
  }
}

TEST(SensorNoise, LeakAddsToTheSlopeOfTheIntensity) {
  SensorSpec spec = exact_sensor(0.2);
  spec.leak_rate_hz = 1;  // the level falls by about 0.2 a second
  constexpr ImageSize kOnePixel{1, 1};
  const auto watch = [&](double from, double to) {
    Sensor sensor(spec, kOnePixel, CounterRandom(1));
    sensor.step(log_image(kOnePixel, from, spec), 0);
    return sensor.step(log_image(kOnePixel, to, spec), 10);
  };
  const std::vector<Event> still = watch(-2, -2);
  ASSERT_GE(still.size(), 2u);
  const double own_hz = 1 / (still[1].t_s - still[0].t_s);
  const std::vector<Event> rising = watch(-3, -2);  // 0.1 a second more
  ASSERT_GE(rising.size(), 2u);
  EXPECT_NEAR(1 / (rising[1].t_s - rising[0].t_s), own_hz + 0.1 / 0.2, 1e-3);
  // Against it: what falls as fast as the level has no event.
  EXPECT_THAT(watch(-1, -1 - 0.2 * own_hz * 10), IsEmpty());
}

TEST(SensorNoise, ShotNoiseHasTheSetRateWithoutMotion) {
  SensorSpec spec;
  spec.shot_noise_rate_hz = 3;
  const std::vector<Event> events = watch_still(spec, 4, 9);
  const double light = std::exp(-1) - spec.log_epsilon;
  const double of_a_pixel = 3.0 * 4 * (1 - 0.75 * light);
  const double expected = of_a_pixel * static_cast<double>(kNoisySize.pixel_count());
  EXPECT_NEAR(static_cast<double>(events.size()), expected,
              4 * std::sqrt(expected + of_a_pixel * expected * kRateVariance));
  double positive = 0;
  for (const Event& event : events) positive += event.positive;
  const auto count = static_cast<double>(events.size());
  EXPECT_NEAR(positive, count / 2, 4 * std::sqrt(count) / 2);
}

// From black to white on a line of the logarithm: most of the time it is dark.
TEST(SensorNoise, ShotNoiseFollowsTheLightOfTheMoment) {
  SensorSpec spec = exact_sensor(5);  // no event of the change
  spec.shot_noise_rate_hz = 8;
  constexpr double kBlack = -4, kWhite = 0;
  double seen = 0;  // mean of 1 - 0.75 I over the way
  for (int i = 0; i < 1000; ++i) {
    seen += 1 - 0.75 * (std::exp(kBlack + (kWhite - kBlack) * (i + 0.5) / 1000) - spec.log_epsilon);
  }
  seen /= 1000;
  for (const int steps : {1, 8}) {
    Sensor sensor(spec, kNoisySize, CounterRandom(4));
    double count = 0, late = 0;
    for (int step = 0; step <= steps; ++step) {
      const double part = static_cast<double>(step) / steps;
      const auto events =
          sensor.step(log_image(kNoisySize, kBlack + (kWhite - kBlack) * part, spec), 4 * part);
      count += static_cast<double>(events.size());
      for (const Event& event : events) late += event.t_s > 2;
    }
    const double dark = 8.0 * 4 * static_cast<double>(kNoisySize.pixel_count());
    EXPECT_NEAR(count / dark, seen, 0.06);
    EXPECT_LT(late, 0.47 * count);
  }
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
  // By pixel: times are the same up to rounding.
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
  // Noise far denser than the motion: hardly a pixel gets a full threshold away between two
  // resets (0.3 log units at 0.1 a second, 50 resets a second: chance exp(-50 · 3)). That of hot
  // pixels, which light does not change.
  SensorSpec noisy = exact_sensor(0.3);
  noisy.hot_pixel_fraction = 1;
  noisy.hot_pixel_rate_hz = 50;
  Sensor moving(noisy, kNoisySize, CounterRandom(1));
  Sensor still(noisy, kNoisySize, CounterRandom(1));
  moving.step(log_image(kNoisySize, -3, noisy), 0);
  still.step(log_image(kNoisySize, -3, noisy), 0);
  const std::vector<Event> while_moving = moving.step(log_image(kNoisySize, -2.5, noisy), 5);
  EXPECT_EQ(while_moving, still.step(log_image(kNoisySize, -3, noisy), 5));
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
