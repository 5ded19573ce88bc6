#include "stages/shards/shard_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "stages/shards/shard_tables.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(ShardContents, AreWhatTheWriterHasStored) {
  const testing::TemporaryFolder folder;
  const testing::ExampleShard example = testing::example_shard();
  const CommitRecord record = write_shard(folder.path(), example);

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
  EXPECT_EQ(record.contents.boxes, boxes);
  EXPECT_EQ(record.contents.persons, persons);
  EXPECT_EQ(record.contents.classes, classes);
  EXPECT_EQ(record.contents.gaps, gaps);
  EXPECT_THAT(
      record.contents.optional_columns,
      ElementsAre("/events/tiles", "/events/statistics/generated_fraction", "/pairs/prev_time_s",
                  "/pairs/next_time_s", "/pairs/subject", "/pairs/action", "/pairs/camera",
                  "/pairs/drive", "/pairs/motion", "/pairs/threshold", "/labels/projection",
                  "/labels/projection_source", "/labels/flow", "/labels/flow_valid",
                  "/labels/boxes/difficulty", "/labels/boxes/outline", "/labels/boxes/motion",
                  "/labels/poses/box", "/labels/poses/box_source", "/labels/poses/joints3d_mm",
                  "/labels/poses/camera", "/labels/poses/camera_source",
                  "/labels/poses/camera_distortion"));
}

TEST(ShardOverview, HasItsColumnsAndNoOthers) {
  const testing::TemporaryFolder folder;
  const testing::ExampleShard example = testing::example_shard();
  const CommitRecord record = write_shard(folder.path(), example);
  const ShardOverview overview = read_overview(folder / record.shard);
  EXPECT_EQ(overview.header.name, record.shard);
  const ShardTables& tables = overview.tables;
  ASSERT_EQ(tables.valid.size(), example.samples.size());
  std::size_t boxes = 0;
  for (std::size_t i = 0; i < example.samples.size(); ++i) {
    const ShardSample& sample = example.samples[i];
    EXPECT_EQ(tables.valid[i], sample.valid);
    EXPECT_EQ(tables.pairs.sample_id[i], sample.sample_id);
    EXPECT_EQ(tables.pairs.sequence[i], sample.sequence);
    EXPECT_EQ(tables.pairs.gap_frames[i], sample.pair.gap_frames);
    EXPECT_EQ(tables.pairs.label_index[i], sample.pair.label_index);
    EXPECT_EQ(tables.events.flags[i], sample.statistics.flags);
    EXPECT_EQ(tables.events.sum_positive[i], sample.statistics.sum_positive);
    EXPECT_EQ(tables.events.sum_negative[i], sample.statistics.sum_negative);
    for (const VolumeBox& box : sample.labels.boxes) {
      EXPECT_EQ(tables.boxes.xyxy[4 * boxes], box.clipped.left);
      EXPECT_EQ(tables.boxes.ignore[boxes], box.ignore);
      ++boxes;
    }
  }
  EXPECT_EQ(tables.boxes.class_id.size(), boxes);
  EXPECT_TRUE(tables.original.empty());
  EXPECT_TRUE(tables.pairs.prev_path.empty());
  EXPECT_TRUE(tables.poses.joints.empty());
}

TEST(ShardContents, OfAShardWithoutLabelsAreZerosAndOfNoRowsEmpty) {
  const testing::TemporaryFolder folder;
  const CommitRecord record = write_shard(folder.path(), testing::unlabelled_shard());
  EXPECT_EQ(record.contents.boxes, std::vector<std::int32_t>{0});
  EXPECT_EQ(record.contents.persons, std::vector<std::int32_t>{0});
  EXPECT_TRUE(record.contents.classes.empty());
  EXPECT_EQ(record.contents.gaps.size(), 1u);
  EXPECT_THAT(record.contents.optional_columns,
              ElementsAre("/pairs/prev_time_s", "/pairs/next_time_s", "/pairs/subject",
                          "/pairs/camera", "/pairs/drive"));
  EXPECT_EQ(contents_of(ShardTables{}, ShardHeader{}), ShardContents{});
}

class ShardSummary : public ::testing::Test {
 protected:
  static ShardReader open(const testing::TemporaryFolder& folder) {
    return ShardReader(folder / write_shard(folder.path(), testing::example_shard()).shard);
  }

  testing::TemporaryFolder folder_;
  ShardReader reader_ = open(folder_);
};

TEST_F(ShardSummary, Counts) {
  const auto shard = nlohmann::json::parse(shard_json(reader_));
  EXPECT_EQ(shard["samples"], 5);
  EXPECT_EQ(shard["valid"], 4);
  EXPECT_EQ(shard["empty_volumes"], 1);
  EXPECT_EQ(shard["boxes"], 3);
  EXPECT_EQ(shard["persons"], 3);
  EXPECT_EQ(shard["classes"], (nlohmann::json{{"Car", 2}, {"DontCare", 1}}));
  EXPECT_EQ(shard["gaps"], (nlohmann::json{{"2", 5}}));
  EXPECT_EQ(shard["quarantined"], nlohmann::json::array({"000002"}));
}

TEST_F(ShardSummary, TextSaysWhatIsInTheShardAndFlagsHaveNames) {
  EXPECT_TRUE(flag_names(0).empty());
  EXPECT_THAT(flag_names((1u << 6) - 1), ElementsAre("empty", "extrapolated", "saturated",
                                                     "vanished", "beyond_calibration", "noise"));
  const std::string text = describe_shard(reader_);
  EXPECT_THAT(text, HasSubstr("demo-train-00000-of-00001.h5\n"));
  EXPECT_THAT(text, HasSubstr("5, valid 4"));
  EXPECT_THAT(text, HasSubstr("quarantined    000002\n"));
  EXPECT_THAT(text, HasSubstr("2 polarities x 2 bins, 8x6 pixels, float16, deflate 1"));
  EXPECT_THAT(text, HasSubstr("3 (Car: 2, DontCare: 1)"));
}

TEST_F(ShardSummary, TextSaysWhatIsInASample) {
  const std::string first = describe_sample(reader_, 0);
  EXPECT_THAT(first, HasSubstr("kitti/prev_2/000000_02.png, frame 10\n"));
  EXPECT_THAT(first,
              HasSubstr("Car [1 1 4.25 4.5], source [2 2 8.5 9], outline of 8 corners, track 7\n"));
  EXPECT_THAT(first, HasSubstr("DontCare [0 0 0.5 0.5], source [0 0 1 1], ignore\n"));
  EXPECT_THAT(first, HasSubstr("nose (1.5 1.75), visible\n"));
  EXPECT_THAT(first, HasSubstr("0.2 s"));
  EXPECT_THAT(first, HasSubstr("generated_fraction 0.75 of its tiles\n"));  // 3 of 4
  EXPECT_THAT(first, Not(HasSubstr("motion")));
  EXPECT_THAT(describe_sample(reader_, 4),
              HasSubstr("motion         -1.5 0.25 0.75 1.0078125 px, px, degrees, factor\n"));
  EXPECT_THAT(describe_sample(reader_, 1), Not(HasSubstr("nan")));
  EXPECT_THAT(describe_sample(reader_, 2), HasSubstr("no: quarantined"));
  EXPECT_THROWS(describe_sample(reader_, 5), std::out_of_range, "expected a sample 0..4, got 5");
  EXPECT_THROWS(describe_sample(reader_, -1), std::out_of_range, "expected a sample 0..4, got -1");
}

TEST(ShardText, HasNoControlCharactersOfTheShard) {
  const testing::TemporaryFolder folder;
  testing::ExampleShard example = testing::example_shard();
  for (std::string& name : example.header.label_schema.class_names) name += "\x1b[31m";
  for (std::string& name : example.header.label_schema.joint_names) name += "\x9b";
  for (ShardSample& sample : example.samples) {
    sample.sample_id += "\x1b]0;x\x07\nvalid yes";
    sample.sequence += "\r";
    sample.pair.next.path += "\x7f";
  }
  const ShardReader reader(folder / write_shard(folder.path(), example).shard);
  for (const std::string& text : {describe_shard(reader), describe_sample(reader, 0)}) {
    EXPECT_TRUE(std::ranges::none_of(text, [](unsigned char c) {
      return (c < 0x20 && c != '\n') || c == 0x7f || c == 0x9b;
    })) << text;
  }
  EXPECT_THAT(describe_shard(reader), HasSubstr("Car\\u001b[31m: 2"));
  EXPECT_THAT(describe_sample(reader, 0),
              HasSubstr("000000\\u001b]0;x\\u0007\\nvalid yes, sequence"));
}

TEST_F(ShardSummary, JsonHoldsTheSame) {
  const auto shard = nlohmann::json::parse(shard_json(reader_));
  EXPECT_EQ(shard["size"], (nlohmann::json{{"height", 6}, {"width", 8}}));
  EXPECT_EQ(shard["dtype"], "float16");

  const auto first = nlohmann::json::parse(sample_json(reader_, 0));
  EXPECT_EQ(first["boxes"][0]["xyxy"], (nlohmann::json{1, 1, 4.25, 4.5}));
  EXPECT_EQ(first["boxes"][0]["class"], "Car");
  EXPECT_EQ(first["boxes"][0]["outline"], "[[1,1,4.25,1,4.25,4.5,1,4.5],[2,2,2,3,3,3,3,2]]");
  EXPECT_EQ(first["boxes"][1]["outline"], "");
  EXPECT_EQ(first["joint_names"][0], "nose");
  EXPECT_EQ(first["persons"][1]["joints_source"][0], (nlohmann::json{3.5, 4}));
  EXPECT_EQ(first["persons"][0]["head_box"], (nlohmann::json{-1, -1, -1, -1}));
  EXPECT_TRUE(first["persons"][0]["camera_distortion"].is_null());
  EXPECT_EQ(first["persons"][1]["camera_distortion"][3], -0.0014);  // p1
  EXPECT_EQ(first["persons"][1]["joints3d_mm"],
            nlohmann::json::parse("[[null, null, null], [4, 5, 3001], [7, 8, 3002]]"));
  EXPECT_TRUE(first["motion"].is_null());
  EXPECT_TRUE(first["threshold"].is_null());
  EXPECT_TRUE(first["flow"].is_null());
  EXPECT_EQ(nlohmann::json::parse(sample_json(reader_, 4))["flow"][1][5][7], -0.25);
  EXPECT_EQ(nlohmann::json::parse(sample_json(reader_, 4))["motion"],
            (nlohmann::json{-1.5, 0.25, 0.75, 1.0078125}));
  EXPECT_TRUE(nlohmann::json::parse(sample_json(reader_, 1))["gap_s"].is_null());
  EXPECT_TRUE(nlohmann::json::parse(sample_json(reader_, 2))["source_to_volume"].is_null());
}

TEST_F(ShardSummary, JsonHasEveryColumnUnderItsName) {
  const auto first = nlohmann::json::parse(sample_json(reader_, 0));
  visit_columns(reader_.tables(), reader_.header(), [&](const ColumnSpec& spec, const auto&) {
    const auto& holder = spec.rows == Rows::kBoxes              ? first["boxes"][0]
                         : spec.rows == Rows::kPersons          ? first["persons"][0]
                         : spec.group().starts_with("/events/") ? first["statistics"]
                                                                : first;
    EXPECT_EQ(holder.contains(std::string(spec.name())), spec.rows != Rows::kOffsets) << spec.path;
  });
}

}  // namespace
}  // namespace eventgan
