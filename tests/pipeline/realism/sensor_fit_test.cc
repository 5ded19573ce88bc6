#include "pipeline/realism/sensor_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "manifests/values/poisson_random.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::FakeRecording;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::texts_with;

constexpr ImageSize kSceneSize{64, 64};
constexpr double kInterval_s = 0.05;

struct Scene {
  double positive_threshold = 0.3;
  double negative_threshold = 0.3;
  NoiseSpec noise = {};
  double spread = 0;       ///< of the pixels' thresholds, as a share of them
  int still_columns = 32;  ///< at the left; a texture moves in the others
  int frames = 21;         ///< 20 pairs: 5 are left out, 12 are fitted, 3 are kept
  int hot_events = 0;      ///< of a still pixel, negative, between two frames
};

std::vector<GreyImage> scene_frames(const Scene& scene) {
  const CounterRandom random(7);
  std::vector<GreyImage> frames;
  for (int i = 0; i < scene.frames; ++i) {
    GreyImage& frame =
        frames.emplace_back(kSceneSize, std::vector<std::uint8_t>(kSceneSize.pixel_count()));
    for (int y = 0; y < kSceneSize.height; ++y) {
      for (int x = 0; x < kSceneSize.width; ++x) {
        const int moved = x < scene.still_columns ? x : 1000 + x + i;
        const auto cell = static_cast<std::uint64_t>(y * 10000 + moved);
        frame.pixels[static_cast<std::size_t>(y * kSceneSize.width + x)] =
            static_cast<std::uint8_t>(30 + random.below(cell, 190));
      }
    }
  }
  return frames;
}

void add_noise_events(double mean, bool positive, int interval, std::vector<Event>& events) {
  const CounterRandom random =
      CounterRandom(3).keyed(std::to_string(interval)).keyed(positive ? "positive" : "negative");
  for (int pixel = 0; pixel < static_cast<int>(kSceneSize.pixel_count()); ++pixel) {
    const double count =
        poisson(mean, random, static_cast<std::uint64_t>(pixel), kSceneSize.pixel_count());
    for (int i = 0; i < static_cast<int>(count); ++i) {
      events.push_back(
          {pixel % kSceneSize.width, pixel / kSceneSize.width, 0.5 * kInterval_s, positive});
    }
  }
}

double log_level(const GreyImage& frame, std::size_t pixel) {
  return std::log(frame.pixels[pixel] / 255.0 + kFrameLogEpsilon);
}

/// 1 on average, of about a Gaussian: the sum of twelve uniform numbers.
double own_share(const Scene& scene, std::size_t pixel) {
  double sum = -6;
  for (std::uint64_t i = 0; i < 12; ++i) sum += CounterRandom(11).uniform(12 * pixel + i);
  return 1 + scene.spread * sum;
}

/// Of a camera without noise whose log intensity moves on lines from frame to frame; by pixel.
/// `anew`: each frame sets the pixels' levels.
std::vector<Event> camera_events(const std::vector<GreyImage>& frames, const Scene& scene,
                                 bool anew) {
  std::vector<Event> events;
  for (std::size_t pixel = 0; pixel < kSceneSize.pixel_count(); ++pixel) {
    double level = log_level(frames[0], pixel);
    const double share = own_share(scene, pixel);
    for (std::size_t i = 0; i + 1 < frames.size(); ++i) {
      const double from = log_level(frames[i], pixel), to = log_level(frames[i + 1], pixel);
      if (anew) level = from;
      for (;;) {
        const bool rises = to > from;
        const double next =
            level + share * (rises ? scene.positive_threshold : -scene.negative_threshold);
        if (rises ? next > to : next < to) break;
        if (to == from) break;
        level = next;
        const double part = (next - from) / (to - from);
        events.push_back({static_cast<int>(pixel) % kSceneSize.width,
                          static_cast<int>(pixel) / kSceneSize.width,
                          (static_cast<double>(i) + std::max(part, 1e-9)) * kInterval_s, rises});
      }
    }
  }
  return events;
}

FakeRecording recording_of(const std::vector<GreyImage>& frames, std::vector<Event> events) {
  std::vector<double> times_s;
  for (std::size_t i = 0; i < frames.size(); ++i) times_s.push_back(double(i) * kInterval_s);
  std::ranges::stable_sort(events, {}, &Event::t_s);
  return {frames, times_s, events};
}

/// What a camera of known thresholds and noise would see of the frames.
FakeRecording scene_recording(const Scene& scene) {
  const std::vector<GreyImage> frames = scene_frames(scene);
  std::vector<Event> events = camera_events(frames, scene, /*anew=*/false);
  const double shot = scene.noise.shot_hz[0] / 2 * kInterval_s;
  for (int i = 0; i + 1 < scene.frames; ++i) {
    const auto first = static_cast<std::ptrdiff_t>(events.size());
    add_noise_events(shot + scene.noise.leak_hz[0] * kInterval_s, true, i, events);
    add_noise_events(shot, false, i, events);
    for (int event = 0; event < scene.hot_events; ++event) {
      events.push_back({5, 40, 0.25 * kInterval_s, false});
    }
    std::for_each(events.begin() + first, events.end(),
                  [&](Event& event) { event.t_s += i * kInterval_s; });
  }
  return recording_of(frames, std::move(events));
}

/// Soft waves before a camera that pans; the first `earlier` frames are before frame 0.
std::vector<GreyImage> panned_frames(int count, int earlier, double speed) {
  std::vector<GreyImage> frames;
  for (int i = -earlier; i < count; ++i) {
    GreyImage& frame =
        frames.emplace_back(kSceneSize, std::vector<std::uint8_t>(kSceneSize.pixel_count()));
    for (int y = 0; y < kSceneSize.height; ++y) {
      for (int x = 0; x < kSceneSize.width; ++x) {
        const double at = speed * i;
        const double u = x + 14 * std::sin(0.13 * at);
        const double v = y + 9 * std::sin(0.21 * at + 1) + 0.3 * at;
        const double waves = std::sin(0.21 * u + 0.05 * v) + std::sin(0.17 * v - 0.11 * u) +
                             std::sin(0.31 * u + 0.29 * v);
        frame.pixels[static_cast<std::size_t>(y * kSceneSize.width + x)] =
            static_cast<std::uint8_t>(std::lround(115 + 33 * waves));
      }
    }
  }
  return frames;
}

SensorFit fit_camera(const Recording& recording, const Generator* network = nullptr) {
  const FitPart part{&recording, 0, std::nullopt};
  return fit_sensor({&part, 1}, network, {1}, 2);
}

/// Knows its sensor: gives the change of log intensity in thresholds, as a rate.
class RateGenerator final : public Generator {
 public:
  int bins() const override { return 1; }
  std::optional<ThresholdRange> thresholds() const override { return ThresholdRange{0.05, 1.5}; }
  std::string description() const override { return "rates"; }

  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    const std::size_t pixels = pair.size.pixel_count();
    const auto log_of = [&](std::size_t i) {
      return std::log((pair.frames[i] + 1) / 2 + kFrameLogEpsilon);
    };
    for (std::size_t i = 0; i < pixels; ++i) {
      const double change = log_of(pixels + i) - log_of(i);
      const ContrastThreshold& told = pair.threshold.value();
      volume[i] = static_cast<float>(std::max(change, 0.0) / told.positive());
      volume[pixels + i] = static_cast<float>(std::max(-change, 0.0) / told.negative());
    }
    return {};
  }
};

TEST(FitSensor, FindsTheThresholdAndTheNoiseOfACamera) {
  // 32 x 64 still pixels over 12 pairs of 0.05 s: 1229 pixel seconds, of 3 Hz positive and 2 Hz
  // negative events. Four standard deviations of a rate r are 4 sqrt(r / 1229): 0.2 and 0.16.
  const Scene scene{.noise = {{4, 4}, {1, 1}, {}}};
  const SensorFit fit = fit_camera(scene_recording(scene));
  EXPECT_EQ(fit.fitted_pairs, 12u);
  EXPECT_EQ(fit.kept_pairs, 3u);
  ASSERT_TRUE(fit.noise);
  EXPECT_NEAR(fit.noise->positive_hz, 3, 0.2);
  EXPECT_NEAR(fit.noise->negative_hz, 2, 0.16);
  EXPECT_NEAR(fit.noise->pixel_seconds, 1229, 1229 * 0.1);  // less what is near the texture
  EXPECT_LT(fit.noise->noise.shot_hz[0], 4);
  EXPECT_GT(fit.noise->noise.shot_hz[1], 4 - 0.32);
  EXPECT_LT(fit.noise->noise.leak_hz[0], 1);
  EXPECT_GT(fit.noise->noise.leak_hz[1], 1 - 0.26);
  ASSERT_TRUE(fit.difference);
  EXPECT_NEAR(fit.difference->threshold.mean, 0.3, 0.03);
  EXPECT_LT(fit.difference->mean.low, fit.difference->threshold.mean);
  EXPECT_GT(fit.difference->mean.high, fit.difference->threshold.mean);
  EXPECT_LT(fit.difference->mean.high - fit.difference->mean.low, 0.06);
  EXPECT_FALSE(fit.network);
  EXPECT_THAT(fit.warnings, IsEmpty());
}

TEST(FitSensor, FindsTheThresholdOfACameraThatKeepsItsLevels) {
  struct Case {
    double threshold;
    double spread;
    int earlier;  ///< frames before those that are read
    double speed;
  };
  const Case cases[] = {{0.15, 0.15, 20, 1}, {0.2, 0.15, 20, 1}, {0.4, 0.15, 20, 1},
                        {0.5, 0.02, 0, 1},   {0.7, 0.02, 0, 1},  {0.7, 0.02, 40, 0.3}};
  for (const auto& [threshold, spread, earlier, speed] : cases) {
    SCOPED_TRACE(threshold);
    const double earlier_s = earlier * kInterval_s;
    const Scene scene{
        .positive_threshold = threshold, .negative_threshold = threshold, .spread = spread};
    std::vector<GreyImage> frames = panned_frames(44, earlier, speed);
    std::vector<Event> events = camera_events(frames, scene, /*anew=*/false);
    std::erase_if(events, [&](const Event& event) { return event.t_s <= earlier_s; });
    for (Event& event : events) event.t_s -= earlier_s;
    frames.erase(frames.begin(), frames.begin() + earlier);
    const SensorFit fit = fit_camera(recording_of(frames, events));
    ASSERT_TRUE(fit.difference && fit.difference_anew);
    const bool warns = std::ranges::any_of(fit.warnings, [](const std::string& warning) {
      return warning.find("frames backwards") != std::string::npos;
    });
    EXPECT_TRUE(warns || speed == 1);
    if (warns) continue;
    EXPECT_NEAR(fit.difference->threshold.mean, threshold, 0.05 * threshold);
    // 2 %: a pixel here has one share for both polarities, in the model one for each.
    EXPECT_LT(fit.difference->mean.low, 1.02 * threshold);
    EXPECT_GT(fit.difference->mean.high, 0.98 * threshold);
    EXPECT_LT(*fit.difference_anew, 0.85 * threshold);  // pairs alone lack what came before
    const auto told = fit.sensor("n", "").threshold;    // for convert, whose pairs begin anew
    ASSERT_EQ(told.has_value(), fit.is_better("difference").value());
    if (told) {
      EXPECT_NEAR(told->range[0], *fit.difference_anew, 5e-3 * threshold);
    }
  }
}

TEST(FitSensor, TellsTheThresholdOfACameraThatBeginsAnew) {
  for (const double threshold : {0.15, 0.2, 0.4}) {
    const Scene scene{
        .positive_threshold = threshold, .negative_threshold = threshold, .frames = 7};
    const std::vector<GreyImage> frames = scene_frames(scene);
    const SensorFit fit =
        fit_camera(recording_of(frames, camera_events(frames, scene, /*anew=*/true)));
    ASSERT_TRUE(fit.difference_anew);
    EXPECT_NEAR(*fit.difference_anew, threshold, 0.1 * threshold);
  }
}

TEST(FitSensor, ComparesOnThePairsKeptAside) {
  const SensorFit fit = fit_camera(scene_recording({.noise = {{4, 4}, {1, 1}, {}}}));
  ASSERT_EQ(fit.rows.size(), 3u);
  const double camera = fit.rows[0].events_per_pixel;
  EXPECT_NEAR(fit.rows[1].events_per_pixel, camera, 0.05 * camera);
  // The default threshold of 0.2 makes some 1.5 times the events, without the noise.
  EXPECT_GT(fit.rows[2].events_per_pixel, 1.2 * camera);
}

TEST(FitSensor, LeavesTheEventsOfHotPixelsOut) {
  const SensorFit with = fit_camera(scene_recording({.hot_events = 3000}));
  const SensorFit without = fit_camera(scene_recording({}));
  ASSERT_TRUE(with.noise && with.difference && without.difference);
  EXPECT_EQ(with.noise->hot_pixels, 1u);
  EXPECT_EQ(with.noise->negative_hz, 0);
  EXPECT_EQ(with.difference->threshold, without.difference->threshold);
  EXPECT_EQ(with.rows[0].events_per_pixel, without.rows[0].events_per_pixel);
}

TEST(FitSensor, TellsNeitherNoiseNorRatioThatNoDocumentHolds) {
  const Scene flicker{.noise = {{1200, 1200}, {}, {}}, .frames = 3};
  SensorFit fit = fit_camera(scene_recording(flicker));
  EXPECT_FALSE(fit.sensor("n", "").noise);
  EXPECT_THAT(fit.warnings[0], HasSubstr("events a second, expected at most 1000"));
  const RateGenerator network;
  const Scene scene{.positive_threshold = 0.08, .negative_threshold = 0.5, .frames = 5};
  fit = fit_camera(scene_recording(scene), &network);
  EXPECT_FALSE(fit.network);
  EXPECT_THAT(fit.warnings, ::testing::Contains(HasSubstr("expected 0.2..5")));
  EXPECT_EQ(fit.sensor("n", "").threshold->ratio, 1);
}

TEST(FitSensor, CountsNoTimeTwiceForNoise) {
  const FakeRecording recording = scene_recording({.still_columns = kSceneSize.width});
  const FitPart part{&recording, 0, std::nullopt};
  // Fitted are at a gap of 1 the intervals 5-6 .. 16-17, and at 2 the pairs 4-6 .. 15-17; of all
  // three 25 of the 33 pairs from frame 8 on, which end with frame 9 (1), 10 (2), 11 .. 17 (3) and
  // 18 (1).
  const std::pair<std::vector<int>, int> cases[] = {{{1}, 12}, {{1, 2, 3}, 9}, {{2}, 12}};
  for (const auto& [gaps, intervals] : cases) {
    const SensorFit fit = fit_sensor({&part, 1}, nullptr, gaps, 1);
    const double seconds = fit.noise->pixel_seconds / static_cast<double>(kSceneSize.pixel_count());
    EXPECT_GE(seconds, intervals * kInterval_s - 1e-9);
    EXPECT_LE(seconds, (intervals + 1) * kInterval_s + 1e-9);
  }
}

TEST(FitSensor, FindsThresholdsByPolarityThroughANetwork) {
  const Scene scene{.positive_threshold = 0.25, .negative_threshold = 0.4, .frames = 6};
  const FakeRecording recording = scene_recording(scene);
  // The network's rates are Σ|change| / C: they add up to the camera's events with C = Σ|change| /
  // N.
  double rise = 0, fall = 0;
  for (std::int64_t i = 1; i < 4; ++i) {  // the fitted pairs
    const GreyImage previous = recording.frame(i), next = recording.frame(i + 1);
    for (std::size_t p = 0; p < kSceneSize.pixel_count(); ++p) {
      const double change = std::log(next.pixels[p] / 255.0 + kFrameLogEpsilon) -
                            std::log(previous.pixels[p] / 255.0 + kFrameLogEpsilon);
      (change > 0 ? rise : fall) += std::abs(change);
    }
  }
  const std::vector<Event> events = recording.events_between(1, 4);
  const double positive = static_cast<double>(std::ranges::count(events, true, &Event::positive));
  const double expected_positive = rise / positive;
  const double expected_negative = fall / (static_cast<double>(events.size()) - positive);

  const RateGenerator network;
  const SensorFit fit = fit_camera(recording, &network);
  ASSERT_TRUE(fit.network);
  EXPECT_NEAR(fit.network->threshold.positive(), expected_positive, 0.01 * expected_positive);
  EXPECT_NEAR(fit.network->threshold.negative(), expected_negative, 0.01 * expected_negative);
  EXPECT_LE(fit.network->ratio.low, fit.network->threshold.ratio * 1.01);
  EXPECT_GE(fit.network->ratio.high, fit.network->threshold.ratio * 0.99);
  EXPECT_EQ(fit.rows.size(), 5u);
  // The document has both, each by itself.
  const CameraSensor sensor = fit.sensor("mine", "a test", "abc");
  EXPECT_NEAR(sensor.network->threshold.range[0], fit.network->threshold.mean, 5e-3);
  EXPECT_NEAR(sensor.network->threshold.ratio, fit.network->threshold.ratio, 5e-3);
  EXPECT_EQ(sensor.network->weights, "abc");
  EXPECT_NEAR(sensor.threshold->range[0], *fit.difference_anew, 5e-3);
  EXPECT_EQ(sensor.threshold->ratio, 1);
  EXPECT_EQ(sensor.name, "mine");
  EXPECT_EQ(sensor.origin, "a test");
}

TEST(FitSensor, WithoutStillPixelsTellsNoNoise) {
  const SensorFit fit = fit_camera(scene_recording({.still_columns = 0}));
  EXPECT_FALSE(fit.noise);
  EXPECT_FALSE(fit.sensor("n", "").noise);
  EXPECT_THAT(fit.warnings, texts_with({"no noise"}));
  ASSERT_TRUE(fit.difference);
  EXPECT_NEAR(fit.difference->threshold.mean, 0.3, 0.03);
}

TEST(FitSensor, WithoutEventsTellsNothing) {
  const Scene scene;
  std::vector<double> times_s;
  for (int i = 0; i < scene.frames; ++i) times_s.push_back(i * kInterval_s);
  const RateGenerator network;
  const SensorFit fit = fit_camera(FakeRecording(scene_frames(scene), times_s, {}), &network);
  EXPECT_FALSE(fit.difference || fit.network);
  EXPECT_THAT(fit.warnings,
              texts_with({"no noise, since the recordings have no events", "no threshold"}));
  const CameraSensor sensor = fit.sensor("n", "");
  EXPECT_FALSE(sensor.threshold || sensor.noise);
  const std::string text = to_text(fit);
  EXPECT_THAT(text, ::testing::ContainsRegex("camera +0.0000 +-\n"));
  EXPECT_THAT(text, ::testing::Not(::testing::ContainsRegex("nan|inf")));
}

TEST(FitSensor, OfAStillImageHasNoThresholdEither) {
  // All events are noise, but for chance: no threshold below 5 makes so few of no change.
  const SensorFit fit =
      fit_camera(scene_recording({.noise = {{4, 4}, {}, {}}, .still_columns = kSceneSize.width}));
  EXPECT_FALSE(fit.difference);
  EXPECT_EQ(fit.warnings.size(), 1u);
}

TEST(FitSensor, OfOnePairSaysThatItIsNotSure) {
  const SensorFit fit = fit_camera(scene_recording({.frames = 2}));
  EXPECT_EQ(fit.fitted_pairs, 1u);
  EXPECT_EQ(fit.kept_pairs, 0u);
  EXPECT_THAT(fit.rows, IsEmpty());
  ASSERT_TRUE(fit.difference);
  EXPECT_TRUE(std::isnan(fit.difference->mean.low));
  EXPECT_THAT(fit.warnings, texts_with({"fewer than 3 pairs"}));
  EXPECT_THAT(to_text(fit), ::testing::Not(HasSubstr("nan")));
}

TEST(FitSensor, PoolsRecordingsAndDependsOnNoThreads) {
  const FakeRecording first = scene_recording({.frames = 7});
  const FakeRecording second = scene_recording({.positive_threshold = 0.6, .frames = 9});
  const FitPart parts[] = {{&first, 0, std::nullopt}, {&second, 1, 8}};
  const SensorFit fit = fit_sensor(parts, nullptr, {1}, 1);
  EXPECT_EQ(fit.fitted_pairs, 4u + 5u);
  EXPECT_EQ(fit.kept_pairs, 1u + 1u);
  EXPECT_EQ(fit_sensor(parts, nullptr, {1}, 3).difference->threshold, fit.difference->threshold);
  EXPECT_GT(fit.difference->threshold.mean, 0.31);
}

TEST(FitSensor, KeepsNoPairAsideThatSharesTimeWithAFittedOne) {
  // Of gap 2 the pairs (4,6), .. (18,20): the first 12 end with frame 17; (16,18) begins before it.
  const FakeRecording recording = scene_recording({});
  const FitPart part{&recording, 0, std::nullopt};
  const SensorFit fit = fit_sensor({&part, 1}, nullptr, {2}, 1);
  EXPECT_EQ(fit.fitted_pairs, 12u);
  EXPECT_EQ(fit.kept_pairs, 2u);
}

TEST(FitSensor, RefusesGapsThatCannotBe) {
  const FakeRecording recording = scene_recording({.frames = 3});
  const FitPart part{&recording, 0, std::nullopt};
  EXPECT_THROWS(fit_sensor({&part, 1}, nullptr, {3}, 1), UsageError,
                "expected frames 3 apart, got frames 0:2, in fake recording");
  EXPECT_THROWS(fit_sensor({&part, 1}, nullptr, {}, 1), UsageError,
                "--gaps: expected different numbers of frames, 1 or more");
}

SensorFit made_fit() {
  SensorFit fit;
  fit.fitted_pairs = 21;
  fit.kept_pairs = 7;
  fit.grey_level = 64.04;
  fit.grey_levels = {60, 70};
  fit.difference = FittedThreshold{{0.31234}, {0.3, 0.33}, {}};
  fit.difference_anew = 0.25;
  fit.noise = NoiseFit{{{0.51234, 1}, {0, 0}, {1e-4, 1e-4}}, 0.5, 0.25, 2000, 1000, 1, 21, {}};
  fit.rows = {{"camera", 0.5}, {"difference, fitted", 0.45}};
  return fit;
}

TEST(SensorFit, GivesThreeDigits) {
  const CameraSensor sensor = made_fit().sensor("n", "");
  EXPECT_EQ(sensor.threshold, (ThresholdSpec{{0.25, 0.25}, 1}));  // as convert's pairs
  EXPECT_EQ(sensor.noise, (NoiseSpec{{0.512, 1}, {0, 0}, {1e-4, 1e-4}}));
}

TEST(SensorFitText, DecidesByThePairsKeptAside) {
  SensorFit fit = made_fit();
  EXPECT_THAT(verdict_text(fit, "my.json", ""), HasSubstr("difference: no verdict"));
  fit.rows.push_back({"difference, default", 0.6});  // 1.2 times the camera's; fitted 0.9 times
  EXPECT_EQ(verdict_text(fit, "my.json", ""),
            "difference: the fitted threshold is better than the default (0.90 times the camera's "
            "events on the pairs kept aside, by default 1.20). Put this line into the manifest:\n"
            "  \"generator\": { \"kind\": \"difference\", \"sensor\": \"my.json\" }\n");
  fit.network = FittedThreshold{{0.2}, {}, {}};
  fit.rows.push_back({"network, fitted", 0.45});
  fit.rows.push_back({"network, default", 0.55});  // 1.1 times: 10 % too many are nearer than 10 %
  EXPECT_THAT(verdict_text(fit, "my.json", "shipped:sensor"),  // too few: ln 1.1 < -ln 0.9
              HasSubstr("network: keep the default: the fitted threshold is worse (0.90 times the "
                        "camera's events on the pairs kept aside, by default 1.10)\n"));
  // What is worse is in no document.
  EXPECT_TRUE(fit.sensor("n", "").threshold);
  EXPECT_FALSE(fit.sensor("n", "").network);
}

TEST(SensorFitText, SaysHowSureItIs) {
  const std::string text = to_text(made_fit());
  EXPECT_THAT(text, HasSubstr("21 fitted, 7 kept aside; mean grey level 64, 60..70"));
  EXPECT_THAT(
      text,
      HasSubstr("difference: 0.312 ± 0.015; 0.25 if each pair begins anew, as with convert\n"));
  EXPECT_THAT(text, HasSubstr("shot_hz 0.512..1, leak_hz 0, hot_pixels 0.0001 (1 of them)"));
  EXPECT_THAT(text, HasSubstr("from 1000 pixels, 2 s each, of 21 pairs"));
  EXPECT_THAT(text, ::testing::ContainsRegex("difference, fitted +0.4500 +0.90\n"));
  EXPECT_EQ(
      origin_text(made_fit(), "shipped:sensor"),
      "21 pairs of frames of mean grey level 64 (60..70); threshold 0.25 of difference, of pairs "
      "that begin anew; noise of 2e+03 pixel seconds");
}

}  // namespace
}  // namespace eventgan
