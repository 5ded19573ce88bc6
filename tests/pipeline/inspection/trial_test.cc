#include "pipeline/conversion/trial.h"

#include <gtest/gtest.h>

#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(MeasureTrial, ScalesAFewPairsToTheWholePlan) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 12);
  const PlannedJob job = make_plan(manifest, "w", "e");
  const testing::FakeGenerator generator;
  const TrialEstimate estimate = measure_trial(manifest, job, generator, 2);
  EXPECT_EQ(estimate.pairs_measured, 4);
  EXPECT_EQ(generator.calls(), 5);  // one more to warm up
  EXPECT_GT(estimate.seconds_per_pair, 0);
  EXPECT_NEAR(estimate.seconds, estimate.seconds_per_pair * 11 / 2, 1e-9);
  EXPECT_GT(estimate.stored_bytes, 0);
}

TEST(MeasureTrial, LeavesOutPairsThatFail) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 3);
  const PlannedJob job = make_plan(manifest, "w", "e");
  testing::write_file(folder / "clip" / "f_12.png", "");
  const TrialEstimate estimate = measure_trial(manifest, job, testing::FakeGenerator(), 2);
  EXPECT_EQ(estimate.pairs_measured, 0);
  EXPECT_EQ(estimate.seconds, 0);
}

}  // namespace
}  // namespace eventgan
