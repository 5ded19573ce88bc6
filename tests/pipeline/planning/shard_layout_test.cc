#include "pipeline/planning/shard_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

struct Source {
  std::string split;
  std::vector<ImageSize> sizes;  // of its samples s0, s1, ...; {0, 0}: unknown
};

std::vector<PlannedShard> lay_out(const std::vector<Source>& sources, int samples_per_shard) {
  ShardLayout layout("job", samples_per_shard);
  for (std::size_t i = 0; i < sources.size(); ++i) {
    layout.begin_source(static_cast<int>(i), sources[i].split);
    for (std::size_t k = 0; k < sources[i].sizes.size(); ++k) {
      layout.add({"s" + std::to_string(k), "", "", {}, ""}, sources[i].sizes[k]);
    }
  }
  return layout.finish();
}

std::vector<std::string> ids(const PlannedShard& shard) {
  std::vector<std::string> result;
  for (const PlannedSample& sample : shard.samples) result.push_back(sample.sample_id);
  return result;
}

const ImageSize kSmall{2, 3}, kLarge{20, 30};

TEST(ShardLayout, NumbersShardsWithinTheirSplitOverAllSources) {
  const auto shards =
      lay_out({{"train", {kSmall, kSmall, kSmall}}, {"val", {kSmall}}, {"train", {kSmall}}}, 2);
  ASSERT_EQ(shards.size(), 4u);
  EXPECT_EQ(shards[0].name, "job-train-00000-of-00003.h5");
  EXPECT_EQ(shards[1].name, "job-train-00001-of-00003.h5");
  EXPECT_EQ(shards[2].name, "job-val-00000-of-00001.h5");
  EXPECT_EQ(shards[3].name, "job-train-00002-of-00003.h5");
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s1"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s2"));
  EXPECT_EQ(shards[3].source, 2);
}

TEST(ShardLayout, AShardHoldsOneSize) {
  const auto shards = lay_out({{"train", {kSmall, kLarge, kSmall, kLarge, kLarge}}}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_EQ(shards[0].volume_size, kSmall);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s2"));
  EXPECT_EQ(shards[1].volume_size, kLarge);
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s1", "s3", "s4"));
}

TEST(ShardLayout, UnreadablePicturesKeepASlotAmongTheMostCommonSize) {
  const auto shards = lay_out({{"train", {kSmall, {}, kLarge, kLarge}}}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s1", "s2", "s3"));
}

TEST(ShardLayout, UnreadablePicturesStandInTheirOrderAndFillShards) {
  const auto shards =
      lay_out({{"train", {kSmall, {}, kSmall, kLarge, kSmall, {}}}, {"val", {{}}}}, 2);
  ASSERT_EQ(shards.size(), 5u);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s1"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s2", "s4"));
  EXPECT_THAT(ids(shards[2]), ::testing::ElementsAre("s5"));
  EXPECT_EQ(shards[2].volume_size, kSmall);
  EXPECT_EQ(shards[3].volume_size, kLarge);
  EXPECT_THAT(ids(shards[4]), ::testing::ElementsAre("s0")) << "of the next source";
}

TEST(ShardLayout, WhereNoPictureCanBeReadVolumesAreOnePixel) {
  const auto shards = lay_out({{"train", {{}, {}}}}, 8);
  ASSERT_EQ(shards.size(), 1u);
  EXPECT_EQ(shards[0].volume_size, (ImageSize{1, 1}));
  EXPECT_EQ(shards[0].samples.size(), 2u);
}

TEST(ShardLayout, OfSizesThatAreEquallyCommonTheFirstTakesTheUnreadable) {
  EXPECT_EQ(lay_out({{"train", {{}, kLarge, kSmall}}}, 8)[0].volume_size, kLarge);
  EXPECT_THAT(ids(lay_out({{"train", {{}, kLarge, kSmall}}}, 8)[0]),
              ::testing::ElementsAre("s0", "s1"));
}

TEST(ShardLayout, OfNothingIsNothing) {
  EXPECT_TRUE(lay_out({}, 8).empty());
  EXPECT_TRUE(lay_out({{"train", {}}}, 8).empty());
}

}  // namespace
}  // namespace eventgan
