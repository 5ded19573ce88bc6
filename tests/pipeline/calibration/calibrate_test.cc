#include "pipeline/calibration/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "pipeline/generation/engine_support.h"
#include "stages/generator/calibration/calibration.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/weights_file.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

/// 11 pairs of flat pictures, of which two are held out: the fifth or sixth and the last.
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
  EXPECT_THROW(run(), InputError);
}

TEST_F(Calibrate, StopsBetweenPairs) {
  CalibrationOptions options;
  int asked = 0;
  options.stop_requested = [&] { return ++asked == 4; };
  EXPECT_THROW(run(options), Stopped);
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
