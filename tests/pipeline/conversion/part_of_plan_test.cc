#include "pipeline/conversion/part_of_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Five shards of 0, 1, 2, 3 and 4 samples.
class PartOfPlanTest : public ::testing::Test {
 protected:
  PartOfPlanTest() {
    for (std::size_t i = 0; i < 5; ++i) {
      plan_.shards.push_back({"s", 0, {1, 1}, std::vector<PlannedSample>(i)});
    }
  }
  const PlannedShard* shard(std::size_t i) const { return &plan_.shards[i]; }

  Plan plan_;
};

TEST_F(PartOfPlanTest, EveryShardIsEitherInOrElsewhere) {
  const PartOfPlan split = split_plan(plan_, {1, 2, "--shards"});
  EXPECT_THAT(split.part, ElementsAre(shard(1), shard(3)));
  EXPECT_THAT(split.elsewhere, ElementsAre(shard(0), shard(2), shard(4)));
  EXPECT_EQ(count_samples(split.part), 4);
  EXPECT_EQ(count_samples(split.elsewhere), 6);
}

TEST_F(PartOfPlanTest, AllAndNothing) {
  EXPECT_EQ(split_plan(plan_, {}).part.size(), 5u);
  EXPECT_THAT(split_plan(plan_, {}).elsewhere, IsEmpty());
  EXPECT_THAT(split_plan(plan_, {7, 9, "--shards"}).part, IsEmpty());
  EXPECT_THAT(split_plan(Plan{}, {}).part, IsEmpty());
  EXPECT_EQ(count_samples({}), 0);
}

}  // namespace
}  // namespace eventgan
