#include "pipeline/dataset/dataset_description.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "manifests/values/faults.h"
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::ConvertedFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::parts_of;

TEST(DatasetCounts, AddUp) {
  CommitRecord record;
  record.samples = 3;
  record.valid = 2;
  record.size_bytes = 5'000'000'000;
  record.contents.boxes = {2147483647, 0, 2147483647};
  record.contents.persons = {1, 0, 4};
  record.contents.classes = {{"Car", 4'000'000'000}};
  record.contents.gaps = {{1, 3}};
  DatasetCounts counts;
  EXPECT_EQ(counts.quarantined(), 0);
  add(record, counts);
  record.contents.classes = {{"Van", 1}};
  record.contents.gaps = {{1, 1}, {6, 2}};
  add(record, counts);
  EXPECT_EQ(counts.shards, 2);
  EXPECT_EQ(counts.samples, 6);
  EXPECT_EQ(counts.quarantined(), 2);
  EXPECT_EQ(counts.boxes, 4LL * 2147483647);
  EXPECT_EQ(counts.persons, 10);
  EXPECT_EQ(counts.size_bytes, 10'000'000'000);
  EXPECT_EQ(counts.classes,
            (std::map<std::string, std::int64_t>{{"Car", 4'000'000'000}, {"Van", 1}}));
  EXPECT_EQ(counts.gaps, (std::map<int, std::int64_t>{{1, 4}, {6, 2}}));
}

/// Adds a shard of one sample.
void add_shard(DatasetParts& parts, const std::string& name, int source, ImageSize size) {
  CommitRecord record;
  record.shard = name;
  record.samples = 1;
  record.valid = 1;
  record.contents.boxes = {1};
  record.contents.persons = {0};
  parts.done.push_back({{name, source, size, 1}, ShardCondition::kDone, record});
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

TEST(DatasetViews, OtherSizesDatasetsAndSchemasAreOtherViews) {
  DatasetParts parts = three_sources();
  add_shard(parts, "a", 0, {375, 1242});
  add_shard(parts, "b", 0, {370, 1224});
  add_shard(parts, "c", 1, {375, 1242});
  add_shard(parts, "d", 2, {375, 1242});
  EXPECT_THAT(groups_of(parts),
              ElementsAre("kitti_object-375x1242", "kitti_object-370x1224", "mpii-375x1242"));
  EXPECT_EQ(views_of(parts)[0].layout.sample_count(), 2);
  parts = three_sources();
  parts.headers[1].label_schema.class_names = {"Van", "Car"};
  add_shard(parts, "a", 0, {4, 4});
  add_shard(parts, "b", 1, {4, 4});
  EXPECT_THAT(groups_of(parts), ElementsAre("kitti_object-4x4", "kitti_object-4x4-2"));
  EXPECT_THAT(groups_of(three_sources()), ElementsAre());
}

nlohmann::json description_of(const ConvertedFolder& folder) {
  const DatasetParts parts = parts_of(folder);
  return nlohmann::json::parse(
      describe_dataset(parts, views_of(parts), {std::string(64, 'c'), 77}));
}

TEST(DatasetDescription, SaysWhatTheDatasetIs) {
  const ConvertedFolder folder;
  const nlohmann::json text = description_of(folder);
  EXPECT_EQ(text["format"], "eventgan-dataset");
  EXPECT_EQ(text["version"], "1.0");
  EXPECT_THAT(text["features"],
              ElementsAre("camera", "difficulty", "flow", "joint_aliases", "joints3d", "motion",
                          "object_motion", "origin", "outlines", "person_boxes", "projection",
                          "threshold", "tiles", "times"));
  EXPECT_EQ(text["name"], "demo");
  EXPECT_EQ(text["complete"], true);
  EXPECT_EQ(text["missing"], nlohmann::json::array());
  EXPECT_EQ(text["plan_hash"], folder.plan_hash());
  EXPECT_EQ(text["weights_hash"], std::string(64, 'b'));
  EXPECT_EQ(text["generator"], "a fake generator");
  EXPECT_EQ(text["program_version"], "0.1.0");
  EXPECT_EQ(text["fingerprint"]["cpu"], "x86-64 avx2 fma");
  EXPECT_FALSE(text["fingerprint"].contains("manifest $.seed"));  // is in the settings
  EXPECT_EQ(text["settings"]["seed"], 7);
  EXPECT_FALSE(text.contains("amendments"));
}

TEST(DatasetDescription, CountsInTotalByShardSplitAndDataset) {
  const ConvertedFolder folder;
  const nlohmann::json text = description_of(folder);
  // The example: 5 samples, one in quarantine, 3 boxes (Car, DontCare, Car), 3 persons, gap 2.
  const nlohmann::json& total = text["counts"]["total"];
  EXPECT_EQ(total["shards"], 4);
  EXPECT_EQ(total["samples"], 16);
  EXPECT_EQ(total["valid"], 13);
  EXPECT_EQ(total["quarantined"], 3);
  EXPECT_EQ(total["boxes"], 9);
  EXPECT_EQ(total["boxes_by_class"], (nlohmann::json{{"Car", 6}, {"DontCare", 3}}));
  EXPECT_EQ(total["persons"], 9);
  EXPECT_EQ(total["samples_by_gap"], (nlohmann::json{{"2", 16}}));
  EXPECT_EQ(text["counts"]["by_dataset"], (nlohmann::json{{"kitti_object", total}}));
  EXPECT_EQ(text["counts"]["by_split"]["val"]["samples"], 5);
  EXPECT_EQ(text["counts"]["by_split"]["train"]["samples"], 11);
  const CommitRecord record = folder.record(1);
  EXPECT_EQ(text["shards"][1], (nlohmann::json{{"name", "demo-val-00000-of-00001.h5"},
                                               {"split", "val"},
                                               {"dataset", "kitti_object"},
                                               {"samples", 5},
                                               {"valid", 4},
                                               {"boxes", 3},
                                               {"persons", 3},
                                               {"size_bytes", record.size_bytes},
                                               {"sha256", record.sha256}}));
}

TEST(DatasetDescription, NamesQuarantinedSamplesTheViewAndItsSplits) {
  const nlohmann::json text = description_of(ConvertedFolder());
  ASSERT_EQ(text["quarantined"].size(), 3u);
  EXPECT_EQ(text["quarantined"][1],
            (nlohmann::json{{"sample_id", "000002"},
                            {"shard", "demo-val-00000-of-00001.h5"},
                            {"slot", 2},
                            {"reason", "cannot decode kitti/image_2/000002.png (000002)"}}));
  const nlohmann::json view = description_of(ConvertedFolder())["view"];
  EXPECT_EQ(view["name"], "dataset.h5");
  EXPECT_EQ(view["sha256"], std::string(64, 'c'));
  EXPECT_EQ(view["size_bytes"], 77);
  EXPECT_EQ(view["views"][0]["group"], "/");
  EXPECT_EQ(view["views"][0]["volume_shape"], (nlohmann::json{4, 6, 8}));
  EXPECT_EQ(view["views"][0]["splits"][1],
            (nlohmann::json{{"name", "val"}, {"first", 11}, {"rows", 5}}));
}

TEST(DatasetDescription, OfASourceWithoutShardsTheNamesAreUnknownAndAmendmentsAreTold) {
  nlohmann::json text = description_of(ConvertedFolder(1));
  EXPECT_EQ(text["complete"], false);
  EXPECT_EQ(text["missing"].size(), 3u);
  EXPECT_EQ(text["sources"][0]["class_names"], (nlohmann::json{"Car", "DontCare"}));
  EXPECT_EQ(text["sources"][0]["labelled_frames"], 6);
  EXPECT_EQ(text["sources"][1]["class_names"], nlohmann::json());
  const ConvertedFolder folder;
  record_amendment(folder.path(), folder.plan_hash(), {{{"annotations", "4567"}}, {"000002"}});
  text = description_of(folder);
  EXPECT_EQ(text["fingerprint"]["annotations"], "4567");
  EXPECT_EQ(
      text["amendments"],
      nlohmann::json::array({{{"fields", {{"annotations", "4567"}}}, {"samples", {"000002"}}}}));
}

TEST(DatasetDescription, BeforeThereIsAViewItIsTheSameWithoutIt) {
  const ConvertedFolder folder(2);
  nlohmann::json text = description_of(folder);
  EXPECT_EQ(text.erase("view"), 1u);
  EXPECT_EQ(nlohmann::json::parse(describe_dataset(read_dataset_parts(folder.path()))), text);
}

TEST(DatasetText, TellsAPersonWhatThereIs) {
  // Two shards of the example: 5 samples, one in quarantine, 3 boxes, 3 persons each.
  const std::string text = dataset_text(read_dataset_parts(ConvertedFolder(2).path()));
  for (const char* part :
       {"2 of 4 done",
        "contents       10 samples, 2 of them quarantined, 6 boxes, 6 persons with joints",
        "split val: 5 samples, 1 of them quarantined, 3 boxes, 3 persons with joints", "8x6",
        "2: 10 (frames: samples)", "Car: 4, DontCare: 2",
        "demo-val-00000-of-00001.h5, 5 samples, 1 of them quarantined"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
  EXPECT_THROWS(read_dataset_parts(ConvertedFolder(0).path()), InputError,
                "expected finished shards, got none");
}

TEST(DatasetDescription, BytesThatAreNoUtf8AreReplaced) {
  const ConvertedFolder folder;
  DatasetParts parts = parts_of(folder);
  parts.done[0].record->quarantined[0].reason = "cannot read \xff.png";
  EXPECT_NO_THROW(describe_dataset(parts, views_of(parts), {}));
}

}  // namespace
}  // namespace eventgan
