#include "pipeline/calibration/calibration_samples.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

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

TEST(CalibrationSamples, AreSpreadEvenlyAndEveryFifthOfThemIsHeldOut) {
  // 100 samples, 8 + 2: one of each ten.
  const Plan plan = plan_of({100});
  const auto samples = choose_calibration_samples(plan, 8, 2);
  EXPECT_THAT(ids(samples, false),
              ::testing::ElementsAre("0", "10", "20", "30", "50", "60", "70", "80"));
  EXPECT_THAT(ids(samples, true), ::testing::ElementsAre("40", "90"));
}

TEST(CalibrationSamples, TakeOfEachSourceInProportion) {
  const Plan plan = plan_of({300, 60, 40});
  std::vector<int> of_source(3);
  for (const auto& sample : choose_calibration_samples(plan, 32, 8))
    ++of_source[sample.shard->source];
  EXPECT_THAT(of_source, ::testing::ElementsAre(30, 6, 4));
}

TEST(CalibrationSamples, LeaveOutKnownFaults) {
  Plan plan = plan_of({4, 4});
  for (const int slot : {0, 1, 3}) plan.shards[0].samples[slot].fault = "a hole";
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

}  // namespace
}  // namespace eventgan
