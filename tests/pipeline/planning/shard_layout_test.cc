#include "pipeline/planning/shard_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

SizedSamples samples(int source, const std::string& split, std::vector<ImageSize> sizes) {
  SizedSamples result{source, split, {}, std::move(sizes)};
  for (std::size_t i = 0; i < result.volume_sizes.size(); ++i) {
    result.samples.push_back({"s" + std::to_string(i), "", "", {}, ""});
  }
  return result;
}

std::vector<std::string> ids(const PlannedShard& shard) {
  std::vector<std::string> result;
  for (const PlannedSample& sample : shard.samples) result.push_back(sample.sample_id);
  return result;
}

const ImageSize kSmall{2, 3}, kLarge{20, 30};

TEST(LayOutShards, NumbersShardsWithinTheirSplitOverAllSources) {
  const auto shards =
      lay_out_shards("job",
                     {samples(0, "train", {3, kSmall}), samples(1, "val", {1, kSmall}),
                      samples(2, "train", {1, kSmall})},
                     2);
  ASSERT_EQ(shards.size(), 4u);
  EXPECT_EQ(shards[0].name, "job-train-00000-of-00003.h5");
  EXPECT_EQ(shards[1].name, "job-train-00001-of-00003.h5");
  EXPECT_EQ(shards[2].name, "job-val-00000-of-00001.h5");
  EXPECT_EQ(shards[3].name, "job-train-00002-of-00003.h5");
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s1"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s2"));
  EXPECT_EQ(shards[3].source, 2);
}

TEST(LayOutShards, AShardHoldsOneSize) {
  const auto shards =
      lay_out_shards("job", {samples(0, "train", {kSmall, kLarge, kSmall, kLarge, kLarge})}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_EQ(shards[0].volume_size, kSmall);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s2"));
  EXPECT_EQ(shards[1].volume_size, kLarge);
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s1", "s3", "s4"));
}

TEST(LayOutShards, UnreadablePicturesKeepASlotAmongTheMostCommonSize) {
  const auto shards = lay_out_shards("job", {samples(0, "train", {kSmall, {}, kLarge, kLarge})}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s1", "s2", "s3"));
  EXPECT_EQ(lay_out_shards("job", {samples(0, "train", {{}, {}})}, 8).at(0).samples.size(), 2u);
}

TEST(LayOutShards, OfNothingIsNothing) {
  EXPECT_TRUE(lay_out_shards("job", {}, 8).empty());
  EXPECT_TRUE(lay_out_shards("job", {samples(0, "train", {})}, 8).empty());
}

}  // namespace
}  // namespace eventgan
