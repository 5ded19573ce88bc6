#include "pipeline/tradeoff/tradeoff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <sstream>

#include "manifests/values/faults.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/image_file.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Reference untrained:2; beside it untrained:1 and the difference, in two sizes and two types.
TradeoffOptions small_options(const testing::TemporaryFolder& folder) {
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
  options.out = folder / "out";
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

TEST(MeasureTradeoff, MeasuresEveryConfigurationOnceAndKeepsIt) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 7);
  TradeoffOptions options = small_options(folder);
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

  std::int64_t again = 0;
  options.make_progress = counting(again);
  const TradeoffReport kept = measure_tradeoff(manifest, options);
  EXPECT_EQ(again, 0);
  ASSERT_EQ(kept.trials.size(), 12u);
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_EQ(kept.trials[i].rounds[1].conversion_s, report.trials[i].rounds[1].conversion_s);
    EXPECT_EQ(kept.trials[i].losses[3].relative_l2, report.trials[i].losses[3].relative_l2);
  }

  options.rounds = 3;  // one more, of all
  measure_tradeoff(manifest, options);
  EXPECT_EQ(again, 6 * 4);
  options.pairs = 3;  // other pairs: nothing of it counts
  measure_tradeoff(manifest, options);
  EXPECT_EQ(again, 6 * 3 + 3 * 6 * 3);
}

TEST(MeasureTradeoff, TellsBeforehandHowMuchItIs) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 7);
  TradeoffOptions options = small_options(folder);
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
  total = 0;
  measure_tradeoff(manifest, options);
  EXPECT_THAT(told,
              ElementsAre(::testing::StartsWith("6 configurations, 4 pairs, 2 rounds: about "),
                          "6 configurations, 4 pairs, 2 rounds: all measured before"));
}

TEST(MeasureTradeoff, FramesOfTheSameNameAndSizeAreOthersIfTheirPixelsAre) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 5);
  TradeoffOptions options = small_options(folder);
  options.axes = {{GeneratorKind::kNetwork},
                  {"untrained:1"},
                  {Precision::kFloat32},
                  {1},
                  {StoredType::kFloat16}};
  options.rounds = 1;
  std::int64_t total = 0;
  options.make_progress = counting(total);
  measure_tradeoff(manifest, options);
  const auto frame = folder / "clip" / "f_11.png";
  const auto size = std::filesystem::file_size(frame);
  testing::write_flat_image(frame, {20, 30}, 21);
  ASSERT_EQ(std::filesystem::file_size(frame), size);
  total = 0;
  measure_tradeoff(manifest, options);
  EXPECT_EQ(total, 2 * 4);
}

TEST(MeasureTradeoff, ScoresAgainstACameraAreKeptByWhatTheCameraSaw) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 5);
  TradeoffOptions options = small_options(folder);
  options.axes = {{GeneratorKind::kNetwork},
                  {"untrained:1"},
                  {Precision::kFloat32},
                  {1},
                  {StoredType::kFloat16, StoredType::kUint8}};
  options.rounds = 1;
  std::int64_t total = 0;
  options.make_progress = counting(total);
  const auto measure = [&](const std::string& name, int step_px) {
    total = 0;
    auto recording = std::make_unique<testing::FakeRecording>(
        testing::moving_bar_recording({16, 20}, 9, step_px));
    recording->set_name(name);
    options.real.clear();
    options.real.push_back(std::move(recording));
    const TradeoffReport report = measure_tradeoff(manifest, options);
    EXPECT_THAT(report.trials.front().real, ElementsAre(::testing::Key(name)));
    return report.trials.front().real.at(name).f1_raw;
  };
  const double score = measure("drive.hdf5", 2);
  EXPECT_EQ(total, 4 + 4 + 4);  // losses, a round, and of 8 intervals as many as pairs
  EXPECT_EQ(measure("./drive.hdf5", 2), score);
  EXPECT_EQ(total, 0) << "it is the same recording";
  const double other = measure("drive.hdf5", 3);
  EXPECT_EQ(total, 4) << "another one by that name";
  EXPECT_NE(other, score);
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

TEST(MeasureTradeoff, GoesOnAfterAStop) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 7);
  TradeoffOptions options = small_options(folder);
  options.axes.weights = {"untrained:2"};
  options.axes.precisions = {Precision::kFloat32};
  std::atomic<int> asked = 0;
  std::int64_t whole = 0;
  options.make_progress = counting(whole);
  int calls_until_stop = 0;
  options.stop_requested = [&] { return calls_until_stop > 0 && ++asked > calls_until_stop; };
  // Late enough that the first losses are kept, early enough that not all are done: the calls of
  // planning and reading, then each pair's.
  for (calls_until_stop = 20; calls_until_stop < 2000; calls_until_stop += 20) {
    asked = 0;
    try {
      measure_tradeoff(manifest, options);
      break;
    } catch (const Stopped&) {
    }
  }
  EXPECT_GT(calls_until_stop, 20);    // it was stopped at least once
  EXPECT_LT(calls_until_stop, 2000);  // and came to its end
  EXPECT_GT(whole, 0);
  EXPECT_LT(whole, 4 * 4 + 2 * 4 * 4);  // the last run had less to do than all
}

TEST(MeasureTradeoff, RefusesWhatCannotBeCompared) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 3);
  TradeoffOptions options = small_options(folder);
  options.axes.sizes = {0.5};  // 15x10 pixels
  EXPECT_THROW(measure_tradeoff(manifest, options), UsageError);
  options.axes.sizes = {1};
  options.reference = {GeneratorKind::kNetwork, "untrained:1", Precision::kInt8, 1};
  EXPECT_THROW(measure_tradeoff(manifest, options), UsageError);
  options.reference.reset();
  options.axes.weights = {"none.safetensors"};
  EXPECT_THROW(measure_tradeoff(manifest, options), InputError);
}

}  // namespace
}  // namespace eventgan
