#include "pipeline/generators/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <set>

#include "manifests/values/faults.h"
#include "pipeline/generators/choose_engine.h"
#include "stages/generator/calibration.h"
#include "stages/generator/weights.h"
#include "stages/generator/weights_file.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// A plan with a shard for each count, its samples named by their numbers.
Plan plan_of(const std::vector<int>& counts) {
  Plan plan;
  int number = 0;
  for (const int count : counts) {
    PlannedShard& shard = plan.shards.emplace_back();
    shard.source = static_cast<int>(plan.shards.size()) - 1;
    for (int i = 0; i < count; ++i) {
      shard.samples.emplace_back().sample_id = std::to_string(number++);
    }
  }
  return plan;
}

std::vector<std::string> ids(const std::vector<CalibrationSample>& samples, bool held_out) {
  std::vector<std::string> result;
  for (const CalibrationSample& sample : samples) {
    if (sample.held_out == held_out) result.push_back(sample.planned().sample_id);
  }
  return result;
}

TEST(CalibrationSamples, AreSpreadEvenlyWithoutKnownFaults) {
  // 100 samples, 8 + 2: one of each ten.
  Plan plan = plan_of({100});
  const auto samples = choose_calibration_samples(plan, 8, 2);
  EXPECT_THAT(ids(samples, false),
              ::testing::ElementsAre("0", "10", "20", "30", "50", "60", "70", "80"));
  EXPECT_THAT(ids(samples, true), ::testing::ElementsAre("40", "90"));
  plan = plan_of({300, 60, 40});
  std::vector<int> of_source(3);
  for (const auto& sample : choose_calibration_samples(plan, 32, 8))
    ++of_source[sample.shard->source];
  EXPECT_THAT(of_source, ::testing::ElementsAre(30, 6, 4));
}

TEST(CalibrationSamples, LeaveOutKnownFaults) {
  Plan plan = plan_of({4, 4});
  for (const int slot : {0, 1, 3}) plan.shards[0].samples[slot].fault = "a missing frame";
  const auto samples = choose_calibration_samples(plan, 32, 8);
  EXPECT_THAT(ids(samples, false), ::testing::ElementsAre("2", "4", "5", "6"));
  EXPECT_THAT(ids(samples, true), ::testing::ElementsAre("7"));
}

TEST(CalibrationSamples, OfFewAtMostAFifthIsHeldOut) {
  EXPECT_TRUE(choose_calibration_samples(Plan(), 32, 8).empty());
  for (int count = 1; count <= 60; ++count) {
    const Plan plan = plan_of({count});
    const auto samples = choose_calibration_samples(plan, 32, 8);
    const int held_out = std::min(8, count / 5);
    EXPECT_EQ(std::ssize(ids(samples, true)), held_out) << count;
    EXPECT_EQ(std::ssize(ids(samples, false)), std::min(32, count - held_out)) << count;
    std::set<int> slots;
    for (const auto& sample : samples) slots.insert(sample.slot);
    EXPECT_EQ(slots.size(), samples.size()) << count;
  }
}

TEST(CalibrationSamples, OneIsEnough) {
  const Plan plan = plan_of({7});
  EXPECT_THAT(ids(choose_calibration_samples(plan, 1, 0), false), ::testing::ElementsAre("0"));
  EXPECT_THAT(ids(choose_calibration_samples(plan, 1, 8), true), ::testing::ElementsAre("3"));
}

TEST(RelativeDistance, IsTheNormOfTheDifferenceOverTheReferences) {
  constexpr std::array reference{3.0f, 0.0f, 4.0f};
  constexpr std::array volume{3.0f, 1.0f, 4.0f};
  EXPECT_DOUBLE_EQ(relative_distance(volume, reference), 1.0 / 5);
  EXPECT_EQ(relative_distance(reference, reference), 0);
  constexpr std::array nothing{0.0f, 0.0f, 0.0f};
  EXPECT_EQ(relative_distance(nothing, reference), 1);
}

TEST(RelativeDistance, OfAReferenceWithoutEvents) {
  constexpr std::array nothing{0.0f, 0.0f};
  constexpr std::array faint{0.0f, 1e-30f};
  EXPECT_EQ(relative_distance(nothing, nothing), 0);
  EXPECT_EQ(relative_distance(faint, nothing), std::numeric_limits<double>::infinity());
  EXPECT_EQ(relative_distance({}, {}), 0);
}

class CalibratedFile : public ::testing::Test {
 protected:
  CalibratedFile() { manifest_.directory = folder_.path(); }

  std::filesystem::path file(const std::string& weights,
                             const std::optional<std::string>& out = std::nullopt) {
    manifest_.generator.weights = weights;
    return calibrated_file(manifest_, 16, out);
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
};

TEST_F(CalibratedFile, StandsBesideTheManifestAndIsNamedInIt) {
  EXPECT_EQ(file("shipped"), folder_ / "eventgan-16-calibrated.safetensors");
  EXPECT_EQ(file("shipped:16"), folder_ / "eventgan-16-calibrated.safetensors");
  EXPECT_EQ(file("shipped:sensor"), folder_ / "eventgan-sensor-calibrated.safetensors");
  EXPECT_EQ(file("untrained:16"), folder_ / "untrained-16-calibrated.safetensors");
  EXPECT_EQ(file("a.b.safetensors"), folder_ / "a.b-calibrated.safetensors");
  EXPECT_EQ(file("/elsewhere/w.safetensors"), folder_ / "w-calibrated.safetensors");
  EXPECT_EQ(calibrated_generator_line(manifest_, folder_ / "sub" / "w \"8\".safetensors"),
            R"("generator": { "weights": "sub/w \"8\".safetensors", "precision": "int8" })");
  EXPECT_EQ(calibrated_generator_line(manifest_, "/elsewhere/w.safetensors"),
            R"("generator": { "weights": "/elsewhere/w.safetensors", "precision": "int8" })");
}

TEST_F(CalibratedFile, MustHaveTheRightNameAndIsTheInputOnlyIfThatIsSaid) {
  testing::write_file(folder_ / "w-calibrated.safetensors", "");
  EXPECT_THROWS(file("w-calibrated.safetensors"), UsageError,
                "--out: expected a file for the new calibration, got none");
  EXPECT_EQ(file("w-calibrated.safetensors", folder_ / "w-calibrated.safetensors"),
            folder_ / "w-calibrated.safetensors");
  EXPECT_EQ(file("w-calibrated.safetensors", folder_ / "other.safetensors"),
            folder_ / "other.safetensors");
  for (const std::string out : {"", "w", "w.h5"}) {
    EXPECT_THROWS(file("shipped", folder_ / out), UsageError,
                  "--out: expected a file named *.safetensors, got \"")
        << out;
  }
  EXPECT_THROWS(file("shipped", folder_ / "none" / "w.safetensors"), UsageError,
                "--out: expected a file in an existing folder, got \"");
}

/// 11 pairs of flat images, of which two are held out: the fifth or sixth and the last.
class Calibrate : public ::testing::Test {
 protected:
  Calibrate() : manifest_(testing::make_small_job(folder_, 12)) {}

  CalibrationOutcome run(const CalibrationOptions& options = {}) const {
    return calibrate(manifest_, make_plan(manifest_, "w", "e"), weights_, options);
  }

  void break_frame(int frame) const {
    testing::write_file(folder_ / "clip" / ("f_" + std::to_string(10 + frame) + ".png"), "");
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
  Weights weights_ = untrained_weights(2, 9, 1);
};

TEST_F(Calibrate, UsesPairsOfTheJobAndMeasuresOnOthers) {
  const CalibrationOutcome outcome = run();
  ASSERT_NE(outcome.weights.calibration, nullptr);
  EXPECT_EQ(outcome.weights.calibration->pairs, 9);
  EXPECT_THAT(outcome.weights.calibration->origin, ::testing::StartsWith("job, manifest SHA-256 "));
  EXPECT_THAT(outcome.skipped, ::testing::IsEmpty());
  if (!engine_support(Precision::kInt8).onednn_able) {
    EXPECT_NE(outcome.unmeasured, "");
    return;
  }
  ASSERT_EQ(outcome.distances.size(), 2u);
  for (const double distance : outcome.distances) {
    EXPECT_GT(distance, 0);
    EXPECT_LT(distance, 0.5);
  }
}

TEST_F(Calibrate, LeavesTheWeightsAndIsTheSameAgain) {
  CalibrationOutcome outcome = run();
  EXPECT_EQ(serialize_weights(run().weights), serialize_weights(outcome.weights));
  outcome.weights.calibration = nullptr;
  EXPECT_EQ(serialize_weights(outcome.weights), serialize_weights(weights_));
}

TEST_F(Calibrate, SkipsPairsThatCannotBeRead) {
  break_frame(1);  // of the pairs 0-1 and 1-2
  const CalibrationOutcome outcome = run();
  EXPECT_EQ(outcome.weights.calibration->pairs, 7);
  EXPECT_THAT(outcome.skipped, ::testing::Each(::testing::HasSubstr("f_11.png")));
  EXPECT_EQ(outcome.skipped.size(), 2u);
}

TEST_F(Calibrate, RefusesAJobWithoutAnyPair) {
  for (int frame = 0; frame < 12; ++frame) break_frame(frame);
  EXPECT_THROWS(run(), InputError, "expected readable pairs to calibrate on, got none of 11");
}

TEST_F(Calibrate, StopsBetweenPairs) {
  CalibrationOptions options;
  int asked = 0;
  options.stop_requested = [&] { return ++asked == 4; };
  EXPECT_THROWS(run(options), Stopped, "stopped on request; nothing was written");
  EXPECT_EQ(asked, 4);
}

TEST_F(Calibrate, WithoutPairsToSpareMeasuresNothing) {
  CalibrationOptions options;
  options.pairs = 1;
  options.held_out = 0;
  const CalibrationOutcome outcome = run(options);
  EXPECT_EQ(outcome.weights.calibration->pairs, 1);
  EXPECT_THAT(outcome.distances, ::testing::IsEmpty());
}

}  // namespace
}  // namespace eventgan
