#include "pipeline/tradeoff/tradeoff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <memory>
#include <sstream>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Reference untrained:2; beside it untrained:1 and the difference, in two sizes and two types.
TradeoffOptions small_options() {
  TradeoffOptions options;
  options.axes = {{GeneratorKind::kNetwork, GeneratorKind::kDifference},
                  {"untrained:1", "untrained:2"},
                  {Precision::kFloat32, Precision::kInt8},
                  {1, 0.8},
                  {StoredType::kFloat32, StoredType::kUint8}};
  options.only_native = false;
  options.pairs = 4;
  options.rounds = 2;
  options.threads = 2;
  return options;
}

/// Counts the pairs that a measurement announces.
std::function<std::unique_ptr<Progress>(std::int64_t)> counting(std::int64_t& total) {
  return [&total, silent = std::make_shared<std::ostringstream>()](std::int64_t pairs) {
    total = pairs;
    return std::make_unique<Progress>(*silent, ProgressStyle::kNone, nullptr, pairs);
  };
}

const Trial& trial_named(const TradeoffReport& report, const std::string& name) {
  for (const Trial& trial : report.trials) {
    if (name_of(trial.configuration) == name) return trial;
  }
  throw std::out_of_range(name);
}

TEST(MeasureTradeoff, MeasuresEveryConfigurationInEachRound) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 7);
  TradeoffOptions options = small_options();
  std::int64_t total = 0;
  options.make_progress = counting(total);
  const TradeoffReport report = measure_tradeoff(manifest, options);
  EXPECT_EQ(name_of(report.reference), "untrained:2 float32 x1");  // the wider one
  EXPECT_EQ(report.pairs, 4);
  ASSERT_EQ(report.trials.size(), 12u);  // 2 weights and the difference, 2 sizes, 2 types
  // Losses of 6 computations and two rounds of these, one of which is the reference, of 4 pairs.
  EXPECT_EQ(total, 6 * 4 + 2 * 6 * 4);
  for (const Trial& trial : report.trials) {
    EXPECT_EQ(trial.losses.size(), 4u) << name_of(trial.configuration);
    ASSERT_EQ(trial.rounds.size(), 2u);
    for (const RoundCost& cost : trial.rounds) {
      EXPECT_GT(cost.generator_s, 0);
      EXPECT_GT(cost.conversion_s, cost.generator_s);
      EXPECT_GT(cost.pairs_per_s, 0);
      EXPECT_GT(cost.stored_bytes, 0);
    }
  }
  for (const RoundCost& cost : trial_named(report, "untrained:1 float32 x0.8 uint8").rounds) {
    EXPECT_GT(cost.reference_s, 0);
  }
  for (const RoundCost& cost : trial_named(report, "untrained:2 float32 x1 float32").rounds) {
    EXPECT_LT(cost.generator_s, cost.reference_s);  // it is the reference, in another type
  }
  // int8 lacks its calibration, or the processor what it needs: listed with the reason.
  ASSERT_EQ(report.refused.size(), 4u);
  EXPECT_EQ(report.refused[0].computation.precision, Precision::kInt8);
  EXPECT_THAT(report.refused[0].reason, HasSubstr("expected"));
}

TEST(MeasureTradeoff, TellsBeforehandHowMuchItIs) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 7);
  TradeoffOptions options = small_options();
  options.axes.sizes = {1};
  std::vector<std::string> told;
  std::int64_t total = 0;
  options.tell = [&](const std::string& text) {
    EXPECT_EQ(total, 0) << "before the first pair";
    told.push_back(text);
  };
  options.make_progress = counting(total);
  measure_tradeoff(manifest, options);
  EXPECT_GT(total, 0);
  EXPECT_THAT(told,
              ElementsAre(::testing::StartsWith("6 configurations, 4 pairs, 2 rounds: about ")));
}

TEST(MeasureTradeoff, ScoresAgainstACamera) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 5);
  TradeoffOptions options = small_options();
  options.axes = {{GeneratorKind::kNetwork},
                  {"untrained:1"},
                  {Precision::kFloat32},
                  {1},
                  {StoredType::kFloat16, StoredType::kUint8}};
  options.rounds = 1;
  std::int64_t total = 0;
  options.make_progress = counting(total);
  for (const auto& [name, step_px] : {std::pair("slow.hdf5", 2), std::pair("fast.hdf5", 3)}) {
    auto recording = std::make_unique<testing::FakeRecording>(
        testing::moving_bar_recording({16, 20}, 9, step_px));
    recording->set_name(name);
    options.real.push_back(std::move(recording));
  }
  const TradeoffReport report = measure_tradeoff(manifest, options);
  EXPECT_EQ(total, 4 + 4 + 2 * 4);  // losses, a round, and of 8 intervals as many as pairs
  const auto& scores = report.trials.front().real;
  EXPECT_THAT(scores, ElementsAre(::testing::Key("fast.hdf5"), ::testing::Key("slow.hdf5")));
  EXPECT_NE(scores.at("fast.hdf5").f1_raw, scores.at("slow.hdf5").f1_raw);
}

/// A job by weights that know their sensor, of this threshold.
JobManifest sensor_job(const testing::TemporaryFolder& folder, double threshold) {
  std::string text = testing::make_small_job(folder, 5).text;
  const std::string before = R"("weights": "untrained:1")";
  text.replace(text.find(before), before.size(),
               R"("weights": "shipped:sensor", "sensor": { "threshold": [)" +
                   std::to_string(threshold) + ", " + std::to_string(threshold) + "] }");
  return parse_job_manifest(text, folder.path(), "manifest.json");
}

TEST(MeasureTradeoff, VolumesOfACameraAreMadeByTheSensorThatTheJobTells) {
  const testing::TemporaryFolder folder;
  std::vector<double> events;
  for (const double threshold : {0.15, 0.15, 0.6}) {
    const JobManifest manifest = sensor_job(folder, threshold);
    TradeoffOptions options = small_options();
    options.axes = {{GeneratorKind::kNetwork},
                    {"shipped:16", "shipped:sensor"},
                    {Precision::kFloat32},
                    {1},
                    {StoredType::kFloat16}};
    options.rounds = 1;
    options.real.push_back(
        std::make_unique<testing::FakeRecording>(testing::moving_bar_recording({16, 20}, 9, 2)));
    const TradeoffReport report = measure_tradeoff(manifest, options);
    EXPECT_EQ(report.reference.weights, "shipped:sensor") << "the only one that the sensor fits";
    ASSERT_EQ(report.trials.size(), 1u);
    EXPECT_THAT(report.refused, ::testing::SizeIs(1));
    EXPECT_LT(report.trials[0].losses.front().relative_l2, 0.01) << "rates against rates";
    events.push_back(report.trials[0].real.begin()->second.events_per_pixel);
  }
  EXPECT_EQ(events[0], events[1]);
  EXPECT_GT(events[0], events[2]);
}

TEST(DefaultAxes, AreAtMostTenConfigurations) {
  const testing::TemporaryFolder folder;
  JobManifest manifest = testing::make_small_job(folder, 2);
  const auto count = [&] {
    const TradeoffAxes axes = default_axes(manifest);
    return computations(axes).size() * axes.dtypes.size();
  };
  for (const char* weights : {"shipped", "untrained:1", "mine.safetensors"}) {
    manifest.generator.weights = weights;
    EXPECT_LE(count(), 10u) << weights;
    EXPECT_GT(count(), 1u) << weights;
  }
  manifest.generator.kind = GeneratorKind::kEsim;
  manifest.output.dtype = StoredType::kUint8;
  manifest.generator.scope.scope = Scope::kMotion;
  EXPECT_LE(count(), 10u);
  const TradeoffAxes axes = default_axes(manifest);
  EXPECT_THAT(axes.methods, ElementsAre(GeneratorKind::kNetwork, GeneratorKind::kEsim));
  EXPECT_THAT(axes.dtypes, ElementsAre(StoredType::kUint8));
  EXPECT_THAT(axes.scopes, ElementsAre(Scope::kMotion));
}

TEST(MeasureTradeoff, StopsOnRequest) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 7);
  TradeoffOptions options = small_options();
  options.axes.weights = {"untrained:2"};
  options.axes.precisions = {Precision::kFloat32};
  std::atomic<int> asked = 0;
  std::atomic<int> calls_until_stop = std::numeric_limits<int>::max();
  options.stop_requested = [&] { return ++asked > calls_until_stop; };
  measure_tradeoff(manifest, options);
  const int calls = asked;  // those of planning and reading, then of each pair
  ASSERT_GT(calls, 16);
  for (const int part : {1, 2, 3}) {
    asked = 0;
    calls_until_stop = calls * part / 4;
    EXPECT_THROWS(measure_tradeoff(manifest, options), Stopped, "stopped on request") << part;
  }
}

TEST(MeasureTradeoff, RefusesWhatCannotBeCompared) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 3);
  TradeoffOptions options = small_options();
  options.axes.sizes = {0.5};  // 15x10 pixels
  EXPECT_THROWS(measure_tradeoff(manifest, options), UsageError,
                "expected a configuration that can be run, got none");
  options.axes.sizes = {1};
  options.reference = {GeneratorKind::kNetwork, "untrained:1", Precision::kInt8, 1};
  EXPECT_THROWS(measure_tradeoff(manifest, options), UsageError,
                "--reference: expected a configuration that can be run");
  options.reference.reset();
  options.axes.weights = {"none.safetensors"};
  EXPECT_THROWS(measure_tradeoff(manifest, options), InputError,
                "expected a readable file, got 'No such file or directory'");
}

}  // namespace
}  // namespace eventgan
