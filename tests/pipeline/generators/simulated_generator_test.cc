#include "pipeline/generators/simulated_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "manifests/values/events.h"
#include "manifests/values/words.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr ImageSize kSize{12, 16};

GeneratorSpec quiet(GeneratorKind kind) {
  GeneratorSpec spec;
  spec.kind = kind;
  spec.sensor.threshold_spread = 0;
  return spec;
}

/// A frame in [-1, 1] whose left half has one grey value and whose right half another.
std::vector<float> halves(int left, int right) {
  std::vector<float> frame;
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      frame.push_back((static_cast<float>(x < kSize.width / 2 ? left : right) / 255 - 0.5f) * 2);
    }
  }
  return frame;
}

std::vector<float> volume_of(const Generator& generator, std::vector<float> previous,
                             const std::vector<float>& next) {
  previous.insert(previous.end(), next.begin(), next.end());
  std::vector<float> volume(VolumeShape{generator.bins(), kSize}.value_count(), -1);
  generator.generate({previous, kSize}, volume);
  return volume;
}

double sum(const std::vector<float>& volume) {
  return std::accumulate(volume.begin(), volume.end(), 0.0);
}

TEST(Simulators, ARowMakesOneKnownToEveryCommand) {
  for (const GeneratorRow& row : kGenerators) {
    SCOPED_TRACE(row.word);
    const bool is_in_simulate =
        std::ranges::count(kSimulationMethodWords,
                           SimulationMethod{SimulationMethod::kSimulator, row.value},
                           &Word<SimulationMethod>::value) == 1;
    EXPECT_EQ(is_in_simulate, row.has_sensor_settings);
    if (!row.has_sensor_settings) {
      EXPECT_THROWS(simulator(row.value), std::invalid_argument,
                    "expected a kind of simulator, got " + std::string(row.word));
      continue;
    }
    EXPECT_EQ(simulator(row.value).kind, row.value);
    EXPECT_EQ(simulator(row.value).between == nullptr, row.moves_one_frame);
  }
}

TEST(SimulatedGenerator, DifferenceCountsThresholdsPassed) {
  const auto generator = make_simulated_generator(quiet(GeneratorKind::kDifference), 9, 1);
  const std::vector<float> volume = volume_of(*generator, halves(50, 100), halves(200, 100));
  // ln((200/255 + 0.001)/(50/255 + 0.001)) = 1.382: six thresholds of 0.2 in each pixel of one
  // half.
  const double pixels = kSize.height * kSize.width / 2;
  EXPECT_NEAR(sum(volume), 6 * pixels, 1e-3);
  double positive_left = 0;
  for (int bin = 0; bin < 9; ++bin) {
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width / 2; ++x) {
        positive_left +=
            volume[static_cast<std::size_t>((bin * kSize.height + y) * kSize.width + x)];
      }
    }
  }
  EXPECT_NEAR(positive_left, 6 * pixels, 1e-3);
}

/// Events of the difference of 1.382 (as above) with a threshold told by the pair.
double events_at(const GeneratorSpec& spec, std::optional<ContrastThreshold> threshold) {
  std::vector<float> frames = halves(50, 100);
  const std::vector<float> next = halves(200, 100);
  frames.insert(frames.end(), next.begin(), next.end());
  std::vector<float> volume(VolumeShape{9, kSize}.value_count());
  make_simulated_generator(spec, 9, 1)->generate({frames, kSize, threshold}, volume);
  return sum(volume) / (kSize.height * kSize.width / 2);
}

TEST(SimulatedGenerator, APairsThresholdIsInPlaceOfItsOwn) {
  GeneratorSpec spec = quiet(GeneratorKind::kDifference);
  spec.threshold = ThresholdSpec{.range = {0.1, 2}, .spread = 0};
  EXPECT_NEAR(events_at(spec, std::nullopt), 6, 1e-4);  // sensor's 0.2
  EXPECT_NEAR(events_at(spec, ContrastThreshold{0.5}), 2, 1e-4);
  EXPECT_NEAR(events_at(spec, ContrastThreshold{1.3}), 1, 1e-4);
  EXPECT_NEAR(events_at(spec, ContrastThreshold{1.4}), 0, 1e-4);
  // The left half becomes lighter: of a ratio of 4 the positive one is half of the mean.
  EXPECT_NEAR(events_at(spec, ContrastThreshold{1, 4}), 2, 1e-4);
  // 15 % of 1.38, the change, is one standard deviation: half of the pixels reach theirs, of 96
  // within five deviations.
  spec.threshold->spread.reset();
  EXPECT_NEAR(events_at(spec, ContrastThreshold{1.382}), 0.5, 5 * 0.5 / std::sqrt(96));
}

TEST(SimulatedGenerator, AStaticPairIsEmptyForTheDifference) {
  const auto generator = make_simulated_generator(quiet(GeneratorKind::kDifference), 9, 1);
  EXPECT_EQ(sum(volume_of(*generator, halves(0, 255), halves(0, 255))), 0);
}

TEST(SimulatedGenerator, EsimMovesThePreviousFrame) {
  const auto generator = make_simulated_generator(quiet(GeneratorKind::kEsim), 5, 1);
  EXPECT_EQ(generator->bins(), 5);
  EXPECT_GT(sum(volume_of(*generator, halves(50, 200), halves(50, 200))), 0);
  EXPECT_EQ(sum(volume_of(*generator, halves(50, 50), halves(50, 200))), 0);
}

TEST(SimulatedGenerator, EsimSeesWhatIsBetweenTheFramesIfThatIsKnown) {
  const auto generator = make_simulated_generator(quiet(GeneratorKind::kEsim), 5, 1);
  // All of it is 50 at both ends and 200 half-way: ln((200/255 + 0.001)/(50/255 + 0.001)) = 1.382
  // is six thresholds of 0.2 up, and six down again.
  std::vector<double> asked;
  FramesBetween between;
  between.at = [&](double u) {
    asked.push_back(u);
    const auto level = static_cast<std::uint8_t>(u == 0.5 ? 200 : 50);
    return GreyImage{kSize, std::vector<std::uint8_t>(kSize.pixel_count(), level)};
  };
  const std::vector<float> frames(2 * kSize.pixel_count(), (50 / 255.0f - 0.5f) * 2);
  const auto events = [&](double displacement_px) {
    between.displacement_px = displacement_px;
    asked.clear();
    std::vector<float> volume(VolumeShape{5, kSize}.value_count());
    generator->generate({frames, kSize, std::nullopt, &between}, volume);
    return sum(volume) / static_cast<double>(kSize.pixel_count());
  };
  EXPECT_NEAR(events(2), 12, 1e-3);
  EXPECT_THAT(asked, ::testing::ElementsAre(0.5));
  EXPECT_NEAR(events(3.5), 12, 1e-3) << "no more than 1 px a step";
  EXPECT_THAT(asked, ::testing::ElementsAre(0.25, 0.5, 0.75));
  EXPECT_NEAR(events(0), 0, 1e-3);
  EXPECT_THAT(asked, ::testing::IsEmpty());
  // So many that they are seen one by one.
  EXPECT_NEAR(events(200), 12, 1e-3);
  EXPECT_EQ(asked.size(), 199u);
  EXPECT_GE(generator->working_bytes({1000, 1000}), 64'000'000u);
}

TEST(SimulatedGenerator, DependsOnFramesSeedAndSettingsAlone) {
  const GeneratorSpec spec = quiet(GeneratorKind::kEsim);
  const auto frames = halves(50, 200);
  const auto generator = make_simulated_generator(spec, 9, 1);
  const std::vector<float> volume = volume_of(*generator, frames, frames);
  volume_of(*generator, halves(10, 20), frames);
  EXPECT_EQ(volume_of(*generator, frames, frames), volume);
  EXPECT_EQ(volume_of(*make_simulated_generator(spec, 9, 1), frames, frames), volume);
  EXPECT_NE(volume_of(*make_simulated_generator(spec, 9, 2), frames, frames), volume);
  EXPECT_NE(volume_of(*generator, frames, halves(50, 201)), volume);  // another draw
}

TEST(SimulatedGenerator, IsDescribedWithAllItsParameters) {
  GeneratorSpec spec = quiet(GeneratorKind::kEsim);
  const std::string before = make_simulated_generator(spec, 9, 1)->description();
  EXPECT_THAT(before, ::testing::AllOf(::testing::HasSubstr("\"model\":\"esim\""),
                                       ::testing::HasSubstr("\"max_displacement_px\":10.0"),
                                       ::testing::HasSubstr("\"positive_threshold\":0.2")));
  spec.threshold = ThresholdSpec{.range = {0.25, 0.5}};
  EXPECT_THAT(make_simulated_generator(spec, 9, 1)->description(),
              ::testing::HasSubstr("\"threshold\":[0.25,0.5]"));
  spec.threshold.reset();
  spec.sensor.hot_pixel_rate_hz = 3;
  EXPECT_NE(make_simulated_generator(spec, 9, 1)->description(), before);
}

TEST(SimulatedGenerator, RefusesSpansOfAnotherSizeAndTheNetwork) {
  const auto generator = make_simulated_generator(quiet(GeneratorKind::kEsim), 9, 1);
  std::vector<float> frames(2 * kSize.pixel_count()), volume(7);
  EXPECT_THROWS(generator->generate({frames, kSize}, volume), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of 16x12");
  EXPECT_THROWS(make_simulated_generator({}, 9, 1), std::invalid_argument,
                "expected a kind of simulator, got network");
}

TEST(SimulatedGenerator, RefusesNoiseThatDoesNotFitIntoMemory) {
  GeneratorSpec spec = quiet(GeneratorKind::kDifference);
  spec.sensor.shot_noise_rate_hz = 1e6;
  spec.duration_s = 1e9;  // 2e17 events of 12 x 16 pixels
  const auto generator = make_simulated_generator(spec, 9, 1);
  EXPECT_GT(generator->working_bytes(kSize), 0u);
  EXPECT_THROWS(volume_of(*generator, halves(0, 0), halves(0, 0)), std::runtime_error,
                "got about 1.92e+17 events");
}

TEST(SimulatedGenerator, TakesWhatIsNoNumberForBlack) {
  const auto generator = make_simulated_generator(quiet(GeneratorKind::kDifference), 9, 1);
  const std::vector<float> nan(kSize.pixel_count(), std::nanf(""));
  EXPECT_EQ(sum(volume_of(*generator, nan, halves(0, 0))), 0);
}

}  // namespace
}  // namespace eventgan
