#include "pipeline/realism/realism.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/realism/realism_report.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using testing::FakeRecording;
using ::testing::HasSubstr;
using testing::moving_bar_recording;
using ::testing::Not;

RealismOptions models_only() {
  RealismOptions options;
  options.methods = {GeneratorKind::kDifference, GeneratorKind::kEsim};
  options.threads = 2;
  return options;
}

TEST(RealismMethods, AreAllThatMakeVolumesOfFrames) {
  using enum GeneratorKind;
  EXPECT_THAT(realism_methods(), ElementsAre(kNetwork, kDifference, kEsim));
}

TEST(MeasureRealism, ComparesTheModelsWithFittedThresholds) {
  const FakeRecording recording = moving_bar_recording({24, 32}, 6);
  const RealismReport report = measure_realism(recording, models_only());
  ASSERT_EQ(report.methods.size(), 2u);
  EXPECT_EQ(report.intervals.size(), 5u);
  EXPECT_EQ(report.bins, 9);
  // The bar's pixels have one event each, where the frames differ: with a threshold so high that
  // the difference has one too it finds exactly those.
  EXPECT_EQ(report.methods[0].name, "difference");
  EXPECT_THAT(report.methods[0].settings, HasSubstr("fitted"));
  EXPECT_GT(report.methods[0].mean.f1_time, 0.95);
  EXPECT_LT(report.methods[1].mean.f1_time, report.methods[0].mean.f1_time);
  EXPECT_TRUE(report.real.direction.has_value());
}

TEST(MeasureRealism, TakesTheThresholdItIsTold) {
  RealismOptions options = models_only();
  options.threshold = {0.5};
  RealismReport report = measure_realism(moving_bar_recording({12, 16}, 3), options);
  EXPECT_EQ(report.methods[0].settings, "contrast threshold 0.5 of ln(u/255 + 0.02)");
  // ln(u/255 + 0.02) changes by 1.5: positive events have a threshold of 0.25, negative ones of 4.
  options.threshold = {1, 16};
  report = measure_realism(moving_bar_recording({12, 16}, 3), options);
  EXPECT_THAT(report.methods[0].settings, HasSubstr("negative ÷ positive 16"));
  EXPECT_EQ(report.methods[0].mean.positive_share, 1);
}

TEST(MeasureRealism, TellsANetworkNoThresholdThatItHasNotLearnt) {
  RealismOptions options = models_only();
  options.methods = {GeneratorKind::kNetwork};
  options.weights = "shipped:sensor";
  const FakeRecording recording = moving_bar_recording({12, 16}, 3);
  options.network_threshold = {0.9};
  EXPECT_NO_THROW(measure_realism(recording, options));
  options.network_threshold = {0.9, 1.2};
  EXPECT_THROWS(measure_realism(recording, options), UsageError,
                "--threshold: expected 0.0675..0.931 as the weights have");
  options.network_threshold = {0.01};
  EXPECT_THROWS(measure_realism(recording, options), UsageError,
                "--threshold: expected 0.0675..0.931 as the weights have");
  options.network_threshold = {0.3};
  EXPECT_NO_THROW(measure_realism(recording, options));
  options.network_weights = "of others";
  EXPECT_THROWS(measure_realism(recording, options), UsageError,
                "--sensor: expected the threshold of shipped:sensor");
  // Others take none, and the report says so.
  options.weights = "shipped:8";
  EXPECT_EQ(measure_realism(recording, options).methods[0].settings,
            "weights shipped:8, which take no threshold");
}

TEST(MeasureRealism, SameSeedSameReport) {
  const FakeRecording recording = moving_bar_recording({24, 32}, 4);
  RealismOptions options = models_only();
  options.methods = {GeneratorKind::kEsim};
  const auto scores = [&](std::uint64_t seed, int threads) {
    options.seed = seed;
    options.threads = threads;
    RealismReport report = measure_realism(recording, options);
    report.wall_seconds = 0;
    report.seed = 0;
    return to_json({&report, 1});
  };
  EXPECT_EQ(scores(1, 1), scores(1, 3));
  EXPECT_NE(scores(1, 1), scores(2, 1));
}

TEST(MeasureRealism, MakesTheImagesFolder) {
  const testing::TemporaryFolder folder;
  RealismOptions options = models_only();
  options.images = folder / "new/images";
  options.last_frame = 1;
  measure_realism(moving_bar_recording({12, 16}, 3), options);
  EXPECT_TRUE(std::filesystem::exists(options.images / "000000-000001.png"));
}

TEST(MeasureRealism, RefusesOptionsThatCannotBe) {
  const FakeRecording recording = moving_bar_recording({12, 16}, 3);
  RealismOptions none = models_only();
  none.methods = {};
  EXPECT_THROWS(measure_realism(recording, none), UsageError,
                "--with: expected different methods, at least one, got 0, 0");
  RealismOptions twice = models_only();
  twice.methods = {GeneratorKind::kEsim, GeneratorKind::kEsim};
  EXPECT_THROWS(measure_realism(recording, twice), UsageError,
                "--with: expected different methods, at least one, got 2, 1");
  for (const double threshold : {0.0, -1.0, 6.0, std::numeric_limits<double>::quiet_NaN()}) {
    RealismOptions options = models_only();
    options.threshold = {threshold};
    EXPECT_THROWS(measure_realism(recording, options), UsageError,
                  "--threshold: expected fit or a number in 0.01..5")
        << threshold;
  }
  for (const double number : {0.0, -1.0, 200.0, std::numeric_limits<double>::quiet_NaN()}) {
    RealismOptions options = models_only();
    options.log_epsilon = number;
    EXPECT_THROWS(measure_realism(recording, options), UsageError,
                  "--log-epsilon: expected a number in 1e-6..1")
        << number;
    options = models_only();
    options.esim_displacement_px = number;
    EXPECT_THROWS(measure_realism(recording, options), UsageError,
                  "--esim-displacement: expected a number in 0.1..100")
        << number;
  }
  RealismOptions gap = models_only();
  gap.gaps = {7};
  EXPECT_THROWS(measure_realism(recording, gap), UsageError,
                "expected frames 7 apart, got frames 0:2, in fake recording");
}

TEST(MeasureRealism, OfARealRecording) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto recording = open_recording(data / "davis" / "slider_depth", RecordingFormat::kEcd);
  RealismOptions options = models_only();
  options.esim_draws = 1;
  const RealismReport report = measure_realism(*recording, options);
  ASSERT_EQ(report.intervals.size(), 2u);
  EXPECT_NEAR(static_cast<double>(report.intervals[0].event_count), 7778, 5);
  EXPECT_NEAR(static_cast<double>(report.intervals[1].event_count), 11318, 5);
  // Computed apart, from the counts of events: no pixel's sum is far from its clipped one.
  EXPECT_NEAR(report.real.intervals[0].scores.polarity_correlation, 0.7089, 0.005);
  EXPECT_NEAR(report.real.intervals[1].scores.polarity_correlation, 0.7080, 0.005);
  EXPECT_FALSE(report.real.direction.has_value());
  EXPECT_GT(report.methods[0].mean.f1_time, report.methods[1].mean.f1_time);
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

MethodSummary method_of(const std::string& name, double f1, double mse, double events) {
  MethodSummary method;
  method.name = name;
  method.settings = "settings of " + name;
  method.mean.f1_time = f1;
  method.mean.pool_mse_2 = mse;
  method.mean.events_per_pixel = events;
  method.mean.time_correlation = kNaN;
  method.mean.events_per_channel = {events / 4, events / 4, events / 4, events / 4};
  method.intervals.push_back({method.mean, std::nullopt});
  return method;
}

RealismReport two_methods() {
  RealismReport report;
  report.recording = "slider";
  report.size = {180, 240};
  report.bins = 2;
  report.seed = 5;
  report.intervals.push_back({{3, 5}, 0.25, 1234});
  report.real = method_of("real", 1, 0, 0.3);
  report.methods.push_back(method_of("network", 0.5, 0.02, 0.25));
  report.methods.push_back(method_of("difference", 0.25, 0.01, 0.4));
  return report;
}

std::string text_of(const RealismReport& report) { return to_text({&report, 1}); }

TEST(RealismText, MarksTheBestOfEachRowUnlessThereIsButOne) {
  const std::string text = text_of(two_methods());
  EXPECT_THAT(text, ContainsRegex("F1, summed over time +↑ +0.5000\\* +0.2500\n"));
  EXPECT_THAT(text, ContainsRegex("PoolMSE 2 +↓ +0.0200 +0.0100\\*\n"));
  EXPECT_THAT(text, ContainsRegex("events per pixel +≈ +0.3000 +0.2500\\* +0.4000\n"));
  EXPECT_THAT(text, ContainsRegex("in bin 1 +≈ +0.1500 +0.1250\\* +0.2000\n"));
  EXPECT_THAT(text, ContainsRegex("correlation of mean times +↑ +- +-\n"));
  RealismReport report = two_methods();
  report.methods.pop_back();
  EXPECT_THAT(text_of(report), Not(HasSubstr("0.5000*")));
}

TEST(RealismText, EndsWithWhatToTake) {
  RealismReport report = two_methods();
  EXPECT_THAT(
      text_of(report),
      ::testing::EndsWith("By F1 summed over time: network 0.500, difference 0.250. For your "
                          "own videos and sequences take \"network\" as generator.kind.\n"));
  report.methods.push_back(method_of("esim", 0.75, 0.02, 0.3));  // whatever it has here
  EXPECT_THAT(text_of(report), HasSubstr("esim 0.750, network 0.500"));
  EXPECT_THAT(text_of(report),
              HasSubstr("take \"network\" as generator.kind. esim is for photographs"));
  report.intervals[0].event_count = 0;
  EXPECT_THAT(text_of(report), AllOf(HasSubstr("are events and frames on one clock?"),
                                     Not(HasSubstr("generator.kind"))));
  report = two_methods();
  for (MethodSummary& method : report.methods) method.mean.f1_time = 0;
  EXPECT_THAT(text_of(report), Not(HasSubstr("generator.kind")));
}

TEST(RealismText, SaysWhatWasComparedAndHowSureItIs) {
  RealismReport report = two_methods();
  report.methods[0].bounds.emplace();
  report.methods[0].bounds->low.f1_time = 0.44;
  report.methods[0].bounds->high.f1_time = 0.54;
  EXPECT_THAT(text_of(report),
              ContainsRegex("F1, summed over time +↑ +0.5000\\*±0.0500 +0.2500\n"));
  const std::string text = text_of(two_methods());
  EXPECT_THAT(text, HasSubstr("slider: 240x180 pixels, 1 pair of frames (gap 2: 1), 1234 real"));
  EXPECT_THAT(text, HasSubstr("difference: settings of difference"));
  EXPECT_THAT(text, Not(HasSubstr("direction")));
}

TEST(RealismText, HasTheDirectionWhereTheFlowIsKnown) {
  RealismReport report = two_methods();
  report.real.direction = DirectionScore{200, 180};
  report.methods[0].direction = DirectionScore{100, 80};
  report.methods[1].direction = DirectionScore{};
  const std::string text = text_of(report);
  EXPECT_THAT(text, ContainsRegex("direction within 30 deg +↑ +0.9000 +0.8000\\* +-\n"));
  EXPECT_THAT(text, ContainsRegex("pixels that tell it +200 +100 +0\n"));
}

/// As two_methods, another recording, one in which the flow is known.
RealismReport another_recording() {
  RealismReport report = two_methods();
  report.recording = "/recordings/of/a/long/path/drive.hdf5";
  report.methods[0].mean.f1_time = 0.3;
  report.methods[1].mean.f1_time = 0.4;
  report.methods[0].mean.time_correlation = 0.6;
  report.methods[0].direction = DirectionScore{100, 80};
  report.methods[1].direction = DirectionScore{100, 20};
  report.real.direction = DirectionScore{200, 180};
  return report;
}

TEST(RealismText, OfSeveralRecordingsHasARowForEachAndTheMean) {
  const std::string text = to_text(std::vector{two_methods(), another_recording()});
  EXPECT_THAT(text, HasSubstr("slider: 240x180 pixels"));
  EXPECT_THAT(text, HasSubstr("F1, summed over time ↑\n"));
  EXPECT_THAT(text, ContainsRegex("  slider +↑ +0.5000\\* +0.2500\n"));
  EXPECT_THAT(text, ContainsRegex("  ….+path/drive.hdf5 +↑ +0.3000 +0.4000\\*\n"));
  EXPECT_THAT(text, ContainsRegex("  mean +↑ +0.4000\\* +0.3250\n"));
  EXPECT_THAT(text, ContainsRegex("  mean +↑ +0.6000\\* +-\n"));  // over those that have one
  EXPECT_THAT(text, ContainsRegex("  mean +≈ +0.3000 +0.2500\\* +0.4000\n"));
  EXPECT_THAT(text, ContainsRegex("30 deg ↑\n  ….+drive.hdf5 +↑ +0.9000 +0.8000\\* +0.2000\n"));
}

TEST(RealismJson, HasEverything) {
  RealismReport report = two_methods();
  report.methods[0].intervals[0].direction = DirectionScore{7, 3};
  report.methods[0].bounds.emplace();
  report.methods[0].bounds->low.f1_time = 0.44;
  report.methods[0].bounds->high.f1_time = 0.54;
  const auto all = nlohmann::json::parse(to_json(std::vector{report, another_recording()}));
  ASSERT_EQ(all["recordings"].size(), 2u);
  const auto& json = all["recordings"][0];
  EXPECT_EQ(json["recording"], "slider");
  EXPECT_EQ(json["seed"], 5);
  EXPECT_EQ(json["pairs"][0]["gap"], 2);
  EXPECT_EQ(json["pairs"][0]["events"], 1234);
  EXPECT_EQ(json["real"]["mean"]["events_per_pixel"], 0.3);
  const auto& network = json["methods"][0];
  EXPECT_EQ(network["name"], "network");
  EXPECT_EQ(network["mean"]["f1_time"], 0.5);
  EXPECT_EQ(network["bounds"]["f1_time"], nlohmann::json({0.44, 0.54}));
  EXPECT_TRUE(network["mean"]["time_correlation"].is_null());
  EXPECT_EQ(network["mean"]["events_per_channel"].size(), 4u);
  EXPECT_FALSE(network["mean"].contains("direction"));
  EXPECT_EQ(network["pairs"][0]["first_frame"], 3);
  EXPECT_EQ(network["pairs"][0]["direction"]["within_30_deg"], 3);
  EXPECT_EQ(all["mean"]["network"]["f1_time"], 0.4);
  EXPECT_EQ(all["mean"]["real"]["events_per_pixel"], 0.3);
}

}  // namespace
}  // namespace eventgan
