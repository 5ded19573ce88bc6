#include "pipeline/output/shard_states.h"

#include <gtest/gtest.h>

#include "manifests/marker.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

/// Of 100 shards every third is done, the one after it has a torn marker, the next is not there.
TEST(ShardStates, AreInTheOrderOfThePlan) {
  const testing::TemporaryFolder folder;
  FrozenOutline frozen;
  frozen.hash = std::string(64, 'a');
  for (int i = 0; i < 100; ++i) {
    const std::string name = "job-train-" + std::to_string(i) + ".h5";
    frozen.plan.shards.push_back({name, 0, {2, 2}, 1});
    if (i % 3 == 2) continue;
    ShardMarker marker;
    marker.shard = name;
    marker.plan_hash = frozen.hash;
    marker.sha256 = std::string(64, '0');
    marker.size_bytes = 5;
    marker.samples = marker.valid = 1;
    marker.boxes = marker.persons = {0};
    testing::write_file(folder / name, "shard");
    testing::write_file(folder / marker_name(name), i % 3 == 0 ? to_json(marker) : "{");
  }
  const std::vector<ShardState> states = shard_states(folder.path(), frozen);
  ASSERT_EQ(states.size(), 100u);
  for (std::size_t i = 0; i < states.size(); ++i) {
    constexpr ShardCondition kExpected[] = {ShardCondition::kDone, ShardCondition::kTornMarker,
                                            ShardCondition::kMissing};
    EXPECT_EQ(states[i].condition, kExpected[i % 3]) << i;
    EXPECT_EQ(states[i].marker ? states[i].marker->shard : "",
              i % 3 == 0 ? frozen.plan.shards[i].name : "");
  }
}

TEST(ShardStates, OfAnEmptyPlanAreNone) {
  const testing::TemporaryFolder folder;
  EXPECT_TRUE(shard_states(folder.path(), {}).empty());
}

}  // namespace
}  // namespace eventgan
