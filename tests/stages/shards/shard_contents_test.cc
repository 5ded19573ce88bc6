#include "stages/shards/shard_contents.h"

#include <gtest/gtest.h>

#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

TEST(ShardContents, AreWhatTheWriterHasStored) {
  const testing::TemporaryFolder folder;
  const testing::ExampleShard example = testing::example_shard();
  const ShardMarker marker = write_shard(folder.path(), example);

  std::vector<std::int32_t> boxes, persons;
  std::map<std::string, std::int64_t> classes;
  std::map<int, std::int64_t> gaps;
  for (const ShardSample& sample : example.samples) {
    boxes.push_back(static_cast<std::int32_t>(sample.labels.boxes.size()));
    persons.push_back(static_cast<std::int32_t>(sample.labels.persons.size()));
    ++gaps[sample.pair.gap_frames];
    for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
      const auto id = static_cast<std::size_t>(sample.annotation.boxes[i].class_id);
      ++classes[example.header.label_schema.class_names[id]];
    }
  }
  EXPECT_EQ(boxes, (std::vector<std::int32_t>{2, 0, 0, 1, 0}));
  EXPECT_EQ(marker.boxes, boxes);
  EXPECT_EQ(marker.persons, persons);
  EXPECT_EQ(marker.classes, classes);
  EXPECT_EQ(marker.gaps, gaps);
  EXPECT_EQ(
      marker.optional_columns,
      (std::vector<std::string>{"/labels/poses/joints3d_mm", "/labels/poses/camera",
                                "/labels/poses/camera_source", "/labels/poses/camera_distortion"}));
}

TEST(ShardContents, OfAShardWithoutLabelsAreZeros) {
  const testing::TemporaryFolder folder;
  const ShardMarker marker = write_shard(folder.path(), testing::unlabelled_shard());
  EXPECT_EQ(marker.boxes, std::vector<std::int32_t>{0});
  EXPECT_EQ(marker.persons, std::vector<std::int32_t>{0});
  EXPECT_TRUE(marker.classes.empty());
  EXPECT_EQ(marker.gaps.size(), 1u);
  EXPECT_TRUE(marker.optional_columns.empty());
}

TEST(ShardContents, OfNoRowsAreEmpty) {
  EXPECT_EQ(contents_of(ShardTables{}, LabelSchema{}), ShardContents{});
}

TEST(ShardContents, GoIntoAMarkerAndBack) {
  const ShardContents contents{{1, 2}, {0, 3}, {{"Car", 3}}, {{1, 2}}, {"/labels/poses/camera"}};
  ShardMarker marker;
  enter(contents, marker);
  EXPECT_EQ(contents_of(marker), contents);
}

}  // namespace
}  // namespace eventgan
