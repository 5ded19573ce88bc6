#include "pipeline/retry/retry_work.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

PlannedSample sample(const std::string& id, const std::string& next, const std::string& fault) {
  return {id, "", id, {{"p"}, {next}, 1, 0, 1}, fault};
}

/// Three shards of two samples; "b" and "e" were planned with a hole.
Plan plan() {
  Plan plan;
  plan.name = "job";
  plan.sources.resize(2);
  plan.shards = {
      {"job-train-00000-of-00003.h5", 0, {2, 2}, {sample("a", "n", ""), sample("b", "", "hole")}},
      {"job-train-00001-of-00003.h5", 0, {2, 2}, {sample("c", "n", ""), sample("d", "n", "")}},
      {"job-train-00002-of-00003.h5", 1, {2, 2}, {sample("e", "", "hole"), sample("b", "n", "")}}};
  return plan;
}

ShardMarker marker(const PlannedShard& shard, const std::vector<int>& quarantined) {
  ShardMarker marker;
  marker.shard = shard.name;
  marker.plan_hash = marker.sha256 = std::string(64, 'a');
  marker.size_bytes = 1;
  marker.samples = static_cast<int>(shard.samples.size());
  for (const int slot : quarantined) {
    marker.quarantined.push_back(
        {slot, shard.samples[static_cast<std::size_t>(slot)].sample_id, "why"});
  }
  marker.valid = marker.samples - static_cast<int>(quarantined.size());
  marker.boxes = marker.persons = {0, 0};
  return marker;
}

void put(const testing::TemporaryFolder& folder, const ShardMarker& marker) {
  testing::write_file(folder / marker.shard, "x");
  testing::write_file(folder / marker_name(marker.shard), to_json(marker));
}

TEST(FindQuarantined, LooksAtCommittedShardsAlone) {
  const testing::TemporaryFolder folder;
  const FrozenOutline frozen{outline_of(plan()), std::string(64, 'a')};
  put(folder, marker(plan().shards[0], {}));
  put(folder, marker(plan().shards[2], {0, 1}));
  QuarantinedSamples found = find_quarantined(folder.path(), frozen);
  EXPECT_THAT(found.shards, ElementsAre(2u));
  EXPECT_EQ(found.count, 2);
  EXPECT_EQ(found.shards_missing, 1);
  EXPECT_THAT(found.damaged, IsEmpty());

  testing::write_file(folder / "job-train-00002-of-00003.h5", "");
  found = find_quarantined(folder.path(), frozen);
  EXPECT_THAT(found.shards, IsEmpty());
  EXPECT_EQ(found.count, 0);
  EXPECT_THAT(found.damaged, ElementsAre(HasSubstr("job-train-00002-of-00003.h5")));
}

TEST(PlanRetry, TakesQuarantinedSamplesAsTheyArePlanned) {
  Plan frozen = plan();
  frozen.shards[1].size_unknown = true;
  const auto retried = plan_retry({{&frozen.shards[1], marker(frozen.shards[1], {1})},
                                   {&frozen.shards[2], marker(frozen.shards[2], {0, 1})}});
  ASSERT_EQ(retried.size(), 2u);
  EXPECT_EQ(retried[0].name, frozen.shards[1].name);
  EXPECT_EQ(retried[0].volume_size, (ImageSize{2, 2}));
  EXPECT_TRUE(retried[0].size_unknown);
  ASSERT_EQ(retried[0].samples.size(), 1u);
  EXPECT_EQ(retried[0].samples[0].sample_id, "d");
  ASSERT_EQ(retried[1].samples.size(), 2u);
  EXPECT_EQ(retried[1].samples[0].sample_id, "e");
  EXPECT_EQ(retried[1].samples[1].sample_id, "b");
  EXPECT_EQ(retried[1].source, 1);
  EXPECT_FALSE(retried[1].size_unknown);
  EXPECT_THAT(plan_retry({}), IsEmpty());
}

}  // namespace
}  // namespace eventgan
