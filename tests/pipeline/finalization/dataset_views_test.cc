#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/folder/dataset_description.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

/// Adds a shard of one sample.
void add_shard(DatasetParts& parts, const std::string& name, int source, ImageSize size) {
  ShardMarker marker;
  marker.shard = name;
  marker.samples = 1;
  marker.valid = 1;
  marker.boxes = {1};
  marker.persons = {0};
  parts.done.push_back({{name, source, size, 1}, ShardCondition::kDone, marker});
}

/// Three sources, in this order: kitti_object train, kitti_object val, mpii train.
DatasetParts three_sources() {
  DatasetParts parts;
  for (int i = 0; i < 3; ++i) {
    SourceSpec source;
    source.dataset = i == 2 ? DatasetKind::kMpii : DatasetKind::kKittiObject;
    source.split = i == 1 ? "val" : "train";
    parts.manifest.sources.push_back(source);
    ShardHeader& header = parts.headers[i];
    header.dataset = to_string(source.dataset);
    header.volume = {9, {1, 1}};
    header.label_schema = i == 2 ? LabelSchema{{}, {"nose"}} : LabelSchema{{"Car"}, {}};
  }
  return parts;
}

std::vector<std::string> groups_of(const DatasetParts& parts) {
  std::vector<std::string> groups;
  for (const DatasetView& view : views_of(parts)) groups.push_back(view.group);
  return groups;
}

TEST(DatasetViews, ShardsThatAreAlikeAreOneViewAtTheRoot) {
  DatasetParts parts = three_sources();
  add_shard(parts, "a", 0, {375, 1242});
  add_shard(parts, "b", 1, {375, 1242});
  add_shard(parts, "c", 0, {375, 1242});
  const std::vector<DatasetView> views = views_of(parts);
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0].group, "");
  EXPECT_EQ(views[0].header.volume, (VolumeShape{9, {375, 1242}}));
  EXPECT_THAT(views[0].layout.splits,
              ElementsAre(SplitRange{"train", {0, 2}}, SplitRange{"val", {2, 1}}));
}

TEST(DatasetViews, OtherSizesAndOtherDatasetsAreOtherViews) {
  DatasetParts parts = three_sources();
  add_shard(parts, "a", 0, {375, 1242});
  add_shard(parts, "b", 0, {370, 1224});
  add_shard(parts, "c", 1, {375, 1242});
  add_shard(parts, "d", 2, {375, 1242});
  EXPECT_THAT(groups_of(parts),
              ElementsAre("kitti_object-375x1242", "kitti_object-370x1224", "mpii-375x1242"));
  EXPECT_EQ(views_of(parts)[0].layout.sample_count(), 2);
}

TEST(DatasetViews, OtherSchemasAreOtherViews) {
  DatasetParts parts = three_sources();
  parts.headers[1].label_schema.class_names = {"Van", "Car"};
  add_shard(parts, "a", 0, {4, 4});
  add_shard(parts, "b", 1, {4, 4});
  EXPECT_THAT(groups_of(parts), ElementsAre("kitti_object-4x4", "kitti_object-4x4-2"));
}

TEST(DatasetViews, NoShardsNoViews) { EXPECT_THAT(groups_of(three_sources()), ElementsAre()); }

}  // namespace
}  // namespace eventgan
