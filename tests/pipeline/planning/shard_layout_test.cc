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
      const std::string id = "s" + std::to_string(k);
      layout.add({id, "", "", {{"0.png"}, {id + ".png"}}, ""}, sources[i].sizes[k]);
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

TEST(ShardLayout, AnUnreadablePictureHasAShardOfItsOwnThatGuessesTheMostCommonSize) {
  const auto shards =
      lay_out({{"train", {kSmall, {}, kLarge, {}, kLarge}}, {"train", {{}, kSmall}}}, 8);
  ASSERT_EQ(shards.size(), 6u);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s2", "s4"));
  EXPECT_FALSE(shards[1].size_unknown);
  for (const int own : {2, 3}) {
    EXPECT_TRUE(shards[own].size_unknown);
    EXPECT_EQ(shards[own].volume_size, kLarge);
    EXPECT_EQ(shards[own].source, 0);
  }
  EXPECT_THAT(ids(shards[2]), ::testing::ElementsAre("s1"));
  EXPECT_THAT(ids(shards[3]), ::testing::ElementsAre("s3"));
  EXPECT_EQ(shards[5].name, "job-train-00005-of-00006.h5");
  EXPECT_THAT(ids(shards[5]), ::testing::ElementsAre("s0")) << "of the next source";
  EXPECT_EQ(shards[5].volume_size, kSmall);
}

TEST(ShardLayout, WhereNoPictureCanBeReadVolumesAreOnePixel) {
  const auto shards = lay_out({{"train", {{}, {}}}}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_EQ(shards[0].volume_size, (ImageSize{1, 1}));
  EXPECT_TRUE(shards[0].size_unknown);
}

TEST(ShardLayout, OfSizesThatAreEquallyCommonTheFirstIsTheGuess) {
  EXPECT_EQ(lay_out({{"train", {{}, kLarge, kSmall}}}, 8).back().volume_size, kLarge);
}

TEST(ShardLayout, SamplesOfOneUnreadableVideoShareShards) {
  ShardLayout layout("job", 2);
  layout.begin_source(0, "train");
  for (const char* video : {"a.mp4", "a.mp4", "a.mp4", "b.mp4"}) {
    layout.add({video, "", "", {{video}, {video}}, ""}, {});
  }
  const auto shards = layout.finish();
  ASSERT_EQ(shards.size(), 3u);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("a.mp4", "a.mp4"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("a.mp4"));
  EXPECT_THAT(ids(shards[2]), ::testing::ElementsAre("b.mp4"));
}

TEST(ShardLayout, OfNothingIsNothing) {
  EXPECT_TRUE(lay_out({}, 8).empty());
  EXPECT_TRUE(lay_out({{"train", {}}}, 8).empty());
}

}  // namespace
}  // namespace eventgan
