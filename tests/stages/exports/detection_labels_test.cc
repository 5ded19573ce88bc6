#include "stages/exports/detection_labels.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

using Json = nlohmann::json;

TEST(YoloLine, IsCentreAndSizeAsShares) {
  // 10..30 of 80 px: centre 20/80, size 20/80; 8..24 of 64 px: centre 16/64, size 16/64.
  EXPECT_EQ(yolo_line(3, {10, 8, 30, 24}, {64, 80}),
            "3 0.250000000 0.250000000 0.250000000 0.250000000");
  EXPECT_EQ(yolo_line(0, {0, 0, 80, 64}, {64, 80}),
            "0 0.500000000 0.500000000 1.000000000 1.000000000");
}

TEST(YoloLine, NeverLeavesZeroToOne) {
  EXPECT_EQ(yolo_line(0, {-1e-9, 0, 80.00000001, 64}, {64, 80}),
            "0 0.500000000 0.500000000 1.000000000 1.000000000");
}

TEST(YoloDataYaml, NamesClassesChannelsAndLists) {
  EXPECT_EQ(yolo_data_yaml({"Car", "a \"b\""}, 18, {"train", "val"}),
            "path: .\ntrain: train.txt\nval: val.txt\nnc: 2\nchannels: 18\n"
            "names: [\"Car\",\"a \\\"b\\\"\"]\n");
}

TEST(CocoImage, HasSizeAndId) {
  EXPECT_EQ(Json::parse(coco_image(5, "v/a.npy", {60, 80}, "S1/a")), (Json{{"id", 5},
                                                                           {"file_name", "v/a.npy"},
                                                                           {"width", 80},
                                                                           {"height", 60},
                                                                           {"sample_id", "S1/a"}}));
}

TEST(CocoBox, IsLeftTopWidthHeight) {
  const Json json = Json::parse(coco_box({7, 5, 2}, {1.5, 2, 4, 8}, true));
  EXPECT_EQ(json["bbox"], Json({1.5, 2.0, 2.5, 6.0}));
  EXPECT_EQ(json["area"], 15.0);
  EXPECT_EQ(json["iscrowd"], 1);
  EXPECT_EQ(json["id"], 7);
  EXPECT_EQ(json["image_id"], 5);
  EXPECT_EQ(json["category_id"], 2);
}

TEST(CocoPerson, JointsAreMovedByHalfAPixelAndSayHowVisible) {
  const std::vector<ExportedJoint> joints{
      {{10, 20}, 1}, {{11, 21}, 0}, {{12, 22}, -1}, {kMissingPoint, 0}};
  const Json json = Json::parse(coco_person({1, 2, 1}, {0, 0, 4, 5}, joints));
  EXPECT_EQ(json["keypoints"], Json({10.5, 20.5, 2, 11.5, 21.5, 1, 12.5, 22.5, 2, 0, 0, 0}));
  EXPECT_EQ(json["num_keypoints"], 3);
  EXPECT_EQ(json["iscrowd"], 0);
  EXPECT_EQ(json["area"], 20.0);
}

TEST(CocoPersonCategory, CountsJointsFromOne) {
  const Json json = Json::parse(coco_person_category(1, "person", {"a", "b", "c"}, {{0, 2}}));
  EXPECT_EQ(json["skeleton"], Json::parse("[[1, 3]]"));
  EXPECT_EQ(json["keypoints"], Json({"a", "b", "c"}));
  EXPECT_EQ(Json::parse(coco_category(4, "Car")), (Json{{"id", 4}, {"name", "Car"}}));
}

}  // namespace
}  // namespace eventgan
