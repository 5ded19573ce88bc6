#include <gtest/gtest.h>

#include <set>

#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_writer.h"
#include "stages/shards/volume_words_internal.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

TEST(VolumeWords, NameEachUnitDifferently) {
  std::set<std::string> texts;
  for (const Normalization normalization : {Normalization::kNone, Normalization::kEta98}) {
    texts.insert(unit_text(VolumeUnit::kLearned, normalization));
    texts.insert(unit_text(VolumeUnit::kEvents, normalization));
  }
  EXPECT_EQ(texts.size(), 3u);  // a network's volumes are dimensionless either way
}

TEST(VolumeWords, AreThoseOfEarlierShards) {
  // Shards hold these; a change is a change of the format.
  EXPECT_EQ(unit_text(VolumeUnit::kLearned, Normalization::kNone),
            "dimensionless, >= 0; not a count of events");
  EXPECT_EQ(time_axis_text(VolumeUnit::kLearned),
            "bin b of a polarity is centred at time b / (bins - 1), where 0 is the previous frame "
            "and 1 the next one");
}

TEST(VolumeWords, GoThroughAShard) {
  for (const Normalization normalization : {Normalization::kNone, Normalization::kEta98}) {
    const testing::TemporaryFolder folder;
    testing::ExampleShard example = testing::example_shard();
    example.header.unit = VolumeUnit::kEvents;
    example.header.normalization = normalization;
    testing::write_shard(folder.path(), example);
    EXPECT_EQ(ShardReader(folder / example.header.name).header().unit, VolumeUnit::kEvents);
  }
}

}  // namespace
}  // namespace eventgan
