#include "pipeline/realism/volume_method.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "manifests/values/faults.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatEq;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(NetworkMethod, GivesTheFramesToTheGenerator) {
  const auto method = make_network_method(std::make_unique<testing::FakeGenerator>(1), "w.st",
                                          std::nullopt, false, 0);
  // The fake's volume of one bin is max(next - previous, 0) and max(previous - next, 0).
  const IntervalFrames frames{{0, 1}, 0.1, {{1, 2}, {0, 255}}, {{1, 2}, {255, 204}}, 0, 0};
  EXPECT_THAT(method->volume(frames, 0), ElementsAre(2.0f, 0.0f, 0.0f, FloatEq(0.4f)));
  EXPECT_EQ(method->name(), "network");
  EXPECT_EQ(method->draws(), 1);
  EXPECT_EQ(method->settings(), "weights w.st");
}

/// A fake network that knows its sensor.
std::unique_ptr<testing::FakeGenerator> sensor_generator(int bins = 1) {
  auto generator = std::make_unique<testing::FakeGenerator>(bins);
  generator->know({0.01, 5});
  return generator;
}

TEST(NetworkMethod, DrawsEventsOfTheSensorItIsTold) {
  const auto method_of = [](std::uint64_t seed) {
    return make_network_method(sensor_generator(3), "w.st", ContrastThreshold{0.4, 0.25}, true,
                               seed);
  };
  const auto method = method_of(1);
  EXPECT_EQ(method->draws(), 5);
  EXPECT_EQ(
      method->settings(),
      "weights w.st, contrast threshold 0.4 (fitted) of ln(u/255 + 0.02), negative ÷ positive "
      "0.25, mean of 5 draws of events");
  EXPECT_THAT(
      make_network_method(sensor_generator(), "w", ContrastThreshold{0.4}, false, 1)->settings(),
      Not(HasSubstr("fitted")));
  // A rise of 0.1 at each of 64 pixels, of C+ = 0.4 / sqrt(0.25) = 0.8: rates 0.1 (b + 1)/3 / 0.8
  // in the three bins, a quarter of an event in all.
  IntervalFrames frames{{0, 1}, 0.1, {{8, 8}, std::vector<std::uint8_t>(64, 100)}, {}, 0, 0};
  frames.next = {{8, 8}, std::vector<std::uint8_t>(64, 113)};  // 26/255 = 0.102
  const std::vector<float> first = method->volume(frames, 0);
  EXPECT_EQ(method->volume(frames, 0), first);
  EXPECT_NE(method->volume(frames, 1), first);
  EXPECT_NE(method_of(2)->volume(frames, 0), first);
  // An event's values add up to 1 and are normalised by at most 1: some pixels have one, some none.
  int with_events = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    with_events += first[i] + first[64 + i] + first[128 + i] > 0;
    EXPECT_EQ(first[192 + i] + first[256 + i] + first[320 + i], 0) << "nothing falls";
  }
  EXPECT_NEAR(with_events, 64 * 0.255, 5 * std::sqrt(64 * 0.255 * 0.745));
}

TEST(OpenRealismGenerator, RefusesNamesAndFilesThatAreNoWeights) {
  const testing::TemporaryFolder folder;
  EXPECT_THROWS(open_network((folder / "absent.safetensors").string()), InputError,
                "expected a readable file, got 'No such file or directory'");
  EXPECT_THROWS(open_network("shipped:"), UsageError,
                "--weights: expected a file, shipped, shipped:sensor or");
  EXPECT_THROWS(open_network("shipped:8x"), UsageError,
                "--weights: expected a file, shipped, shipped:sensor or");
  EXPECT_THROWS(open_network("shipped:12345"), UsageError,
                "--weights: expected a file, shipped, shipped:sensor or");
  EXPECT_THROWS(
      open_network("shipped:63"), InputError,
      "expected a base width of the shipped weights (8, 16)");  // a width that is not shipped
  EXPECT_THROWS(open_network("untrained:8"), UsageError,
                "--weights: expected a file, shipped, shipped:sensor or");
}

/// Makes round(scale / threshold) events at one pixel.
SimulatedScene inverse_scene(double scale, int draws = 1) {
  return {"inverse",
          [=](const IntervalFrames&, const SensorSpec& sensor, CounterRandom) {
            const double count = std::round(scale / sensor.positive_threshold);
            return std::vector<Event>(static_cast<std::size_t>(count), Event{0, 0, 0.0, true});
          },
          draws};
}

std::vector<IntervalFrames> intervals_of(const std::vector<std::int64_t>& event_counts) {
  std::vector<IntervalFrames> frames;
  for (const std::int64_t count : event_counts) {
    frames.push_back({{0, 1}, 0.1, {{1, 1}, {0}}, {{1, 1}, {0}}, count, 0});
  }
  return frames;
}

TEST(FittedThreshold, MakesAsManyEventsAsTheCameraWithinItsRange) {
  // Two intervals of 1000 / threshold events each against 1000 and 7000: threshold 1/4.
  EXPECT_NEAR(fitted_threshold(inverse_scene(1000), intervals_of({1000, 7000}), 0.02, 0, 2), 0.25,
              0.25 * 0.006);
  EXPECT_NEAR(fitted_threshold(inverse_scene(1000, 3), intervals_of({4000}), 0.02, 0, 2), 0.25,
              0.25 * 0.006);
  EXPECT_NEAR(fitted_threshold(inverse_scene(1000), intervals_of({0}), 0.02, 0, 2), 5, 0.01);
  EXPECT_NEAR(fitted_threshold(inverse_scene(1000), intervals_of({1}), 0.02, 0, 2), 5, 0.01);
  EXPECT_NEAR(fitted_threshold(inverse_scene(0), intervals_of({1000}), 0.02, 0, 2), 0.01, 1e-4);
}

/// One pixel that rises by 2 and one that falls by 0.4, with the camera's events of them.
IntervalFrames rise_and_fall(std::int64_t positive, std::int64_t negative) {
  return {{0, 1}, 0.1, {{1, 2}, {0, 255}}, {{1, 2}, {255, 204}}, positive + negative, positive};
}

TEST(FittedThreshold, OfANetworkIsThatOfEachPolarity) {
  // Rates 2 / C+ and 0.4 / C-, of two intervals: 24 and 4 events are those of 0.1667 and 0.2.
  const std::vector<IntervalFrames> frames{rise_and_fall(20, 1), rise_and_fall(4, 3)};
  for (const int threads : {1, 3}) {
    const ContrastThreshold fitted = fitted_threshold(*sensor_generator(4), frames, threads);
    // Four bins: a quarter, a half, three quarters and one of the change, 2.5 times it.
    EXPECT_NEAR(fitted.positive(), 2.5 * 2 * 2 / 24, 2.5 * 0.1667 * 0.006);
    EXPECT_NEAR(fitted.negative(), 2.5 * 2 * 0.4 / 4, 2.5 * 0.2 * 0.006);
  }
}

TEST(FittedThreshold, OfANetworkStaysInWhatItKnows) {
  const ContrastThreshold silent =
      fitted_threshold(*sensor_generator(), std::vector{rise_and_fall(0, 0)}, 1);
  EXPECT_NEAR(silent.mean, 5, 0.01);
  EXPECT_NEAR(silent.ratio, 1, 0.01);
  const ContrastThreshold rising =
      fitted_threshold(*sensor_generator(), std::vector{rise_and_fall(1'000'000, 0)}, 1);
  EXPECT_NEAR(rising.positive(), 0.01, 1e-4);
  EXPECT_NEAR(rising.negative(), 5, 0.01);
  const ContrastThreshold of_nothing = fitted_threshold(*sensor_generator(), {}, 1);
  EXPECT_TRUE(sensor_generator()->thresholds()->contains(of_nothing.mean)) << of_nothing.mean;
}

TEST(RealismSensor, IsWithoutNoise) {
  const SensorSpec sensor = realism_sensor({0.2}, 0.001);
  EXPECT_EQ(sensor, SensorSpec{});  // 15 % of 0.2 is the default spread of 0.03
  EXPECT_DOUBLE_EQ(realism_sensor({0.4}, 0.02).threshold_spread, 0.06);
  EXPECT_EQ(realism_sensor({0.4}, 0.02).log_epsilon, 0.02);
  EXPECT_EQ(realism_sensor({0.4}, 0.02).negative_threshold, 0.4);
  const SensorSpec unlike = realism_sensor({0.3, 4}, 0.02);
  EXPECT_DOUBLE_EQ(unlike.positive_threshold, 0.15);
  EXPECT_DOUBLE_EQ(unlike.negative_threshold, 0.6);
  EXPECT_DOUBLE_EQ(unlike.threshold_spread, 0.15 * 0.15);
}

IntervalFrames bar_frames() {
  return read_frames(testing::moving_bar_recording({16, 24}, 2, 3), {0, 1});
}

TEST(DifferenceScene, HasEventsWhereTheFramesDiffer) {
  const auto method = make_simulated_method(simulated_scene(GeneratorKind::kDifference),
                                            realism_sensor({0.2}, 0.02), true, 3, 1);
  const IntervalFrames frames = bar_frames();
  const std::vector<float> volume = method->volume(frames, 0);
  const std::size_t plane = frames.previous.pixels.size();
  for (std::size_t i = 0; i < plane; ++i) {
    const float positive = volume[i] + volume[plane + i] + volume[2 * plane + i];
    EXPECT_EQ(positive > 0, frames.next.pixels[i] > frames.previous.pixels[i]) << i;
  }
  EXPECT_THAT(method->settings(), HasSubstr("0.2 (fitted)"));
}

TEST(EsimScene, DrawsDifferAndComeBack) {
  const IntervalFrames frames = bar_frames();
  const auto method = make_simulated_method(simulated_scene(GeneratorKind::kEsim, 5, 2),
                                            realism_sensor({0.2}, 0.02), false, 3, 1);
  EXPECT_EQ(method->draws(), 2);
  const std::vector<float> first = method->volume(frames, 0);
  EXPECT_EQ(method->volume(frames, 0), first);
  EXPECT_NE(method->volume(frames, 1), first);
  EXPECT_GT(std::accumulate(first.begin(), first.end(), 0.0f), 0.0f);
  EXPECT_NE(make_simulated_method(simulated_scene(GeneratorKind::kEsim, 5, 2),
                                  realism_sensor({0.2}, 0.02), false, 3, 2)
                ->volume(frames, 0),
            first);
  EXPECT_THAT(method->settings(), HasSubstr("mean of 2 motions"));
  EXPECT_THAT(method->settings(), Not(HasSubstr("fitted")));
}

}  // namespace
}  // namespace eventgan
