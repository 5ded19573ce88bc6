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

TEST(YoloPoseLine, HasEachJointOrZeros) {
  // Of 80 x 64 px: a pixel's centre is half a pixel from its edge.
  const std::vector<ExportedJoint> joints{{{19.5, 15.5}, 1},  {{39.5, 31.5}, 0}, {{79.5, 63.5}, -1},
                                          {kMissingPoint, 0}, {{79.6, 10}, 1},   {{-0.5, -0.5}, 1}};
  EXPECT_EQ(yolo_pose_line(0, {10, 8, 30, 24}, joints, {64, 80}),
            "0 0.250000000 0.250000000 0.250000000 0.250000000"
            " 0.250000000 0.250000000 2 0.500000000 0.500000000 1 1.000000000 1.000000000 2"
            " 0 0 0 0 0 0 0.000000000 0.000000000 2");
  EXPECT_FALSE(is_within(joints[4], {64, 80}));
}

TEST(FlipIndices, SwapTheSides) {
  using Places = std::vector<int>;
  EXPECT_EQ(flip_indices({"nose", "left_eye", "right_eye"}), (Places{0, 2, 1}));
  EXPECT_EQ(flip_indices({"RKnee", "Root", "LKnee", "Left"}), std::nullopt);
  EXPECT_EQ(flip_indices({"RKnee", "Root", "LKnee"}), (Places{2, 1, 0}));
  EXPECT_EQ(flip_indices({"r_hip", "l_hip", "head_top"}), (Places{1, 0, 2}));
  EXPECT_EQ(flip_indices({"hip_R", "hip_L"}), (Places{1, 0}));
}

TEST(FlipIndices, AreNoneWhereNamesDoNotTell) {
  EXPECT_EQ(flip_indices({}), std::nullopt);
  EXPECT_EQ(flip_indices({"a", "b"}), std::nullopt);
  EXPECT_EQ(flip_indices({"left_eye", "nose"}), std::nullopt);
  EXPECT_EQ(flip_indices({"left_eye", "right_eye", "right_eye"}), std::nullopt);
}

TEST(YoloPoseYaml, HasTheShapeAndHowToMirror) {
  EXPECT_EQ(yolo_pose_yaml({"l_eye", "r_eye"}, 18, {"val"}),
            "path: .\nval: val.txt\nnc: 1\nchannels: 18\nnames: [\"person\"]\nkpt_shape: [2, 3]\n"
            "kpt_names: {0: [\"l_eye\",\"r_eye\"]}\nflip_idx: [1,0]\n");
  EXPECT_EQ(yolo_pose_yaml({"a"}, 18, {}).find("flip_idx"), std::string::npos);
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
  const Json json = Json::parse(coco_person({1, 2, 1}, {0, 0, 4, 5}, false, joints, {40, 30}));
  EXPECT_EQ(json["keypoints"], Json({10.5, 20.5, 2, 11.5, 21.5, 1, 12.5, 22.5, 2, 0, 0, 0}));
  EXPECT_EQ(json["num_keypoints"], 3);
  EXPECT_EQ(json["iscrowd"], 0);
  EXPECT_EQ(json["area"], 20.0);
}

TEST(CocoPerson, JointsThatACropCutsAwayAreNotAnnotated) {
  const std::vector<ExportedJoint> joints{{{-0.6, 2}, 1}, {{-0.5, 2}, 1}, {{3, 4.6}, 0}};
  const Json json = Json::parse(coco_person({1, 2, 1}, {0, 0, 4, 5}, true, joints, {5, 4}));
  EXPECT_EQ(json["keypoints"], Json({0, 0, 0, 0.0, 2.5, 2, 0, 0, 0}));
  EXPECT_EQ(json["num_keypoints"], 1);
  EXPECT_EQ(json["iscrowd"], 1);
}

TEST(CocoPersonCategory, CountsJointsFromOne) {
  const Json json = Json::parse(coco_person_category(1, "person", {"a", "b", "c"}, {{0, 2}}));
  EXPECT_EQ(json["skeleton"], Json::parse("[[1, 3]]"));
  EXPECT_EQ(json["keypoints"], Json({"a", "b", "c"}));
  EXPECT_EQ(Json::parse(coco_category(4, "Car")), (Json{{"id", 4}, {"name", "Car"}}));
}

}  // namespace
}  // namespace eventgan
