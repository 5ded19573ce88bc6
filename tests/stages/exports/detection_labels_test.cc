#include "stages/exports/detection_labels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "manifests/values/outlines.h"

namespace eventgan {
namespace {

using Json = nlohmann::json;

TEST(YoloLine, IsCentreAndSizeAsSharesWithinZeroToOne) {
  // 10..30 of 80 px: centre 20/80, size 20/80; 8..24 of 64 px: centre 16/64, size 16/64.
  EXPECT_EQ(yolo_line(3, {10, 8, 30, 24}, {64, 80}),
            "3 0.250000000 0.250000000 0.250000000 0.250000000");
  EXPECT_EQ(yolo_line(0, {0, 0, 80, 64}, {64, 80}),
            "0 0.500000000 0.500000000 1.000000000 1.000000000");
  EXPECT_EQ(yolo_line(0, {-1e-9, 0, 80.00000001, 64}, {64, 80}),
            "0 0.500000000 0.500000000 1.000000000 1.000000000");
}

TEST(YoloYaml, NamesClassesChannelsListsAndHowToMirror) {
  EXPECT_EQ(yolo_data_yaml({"Car", "a \"b\""}, 18, {"train", "val"}),
            "train: train.txt\nval: val.txt\nnc: 2\nchannels: 18\n"
            "names: [\"Car\",\"a \\\"b\\\"\"]\n");
  EXPECT_EQ(yolo_data_yaml({"Car"}, 3, {"test", "train"}),
            "test: test.txt\ntrain: train.txt\nval: train.txt\nnc: 1\nchannels: 3\n"
            "names: [\"Car\"]\n");
  EXPECT_EQ(yolo_pose_yaml({"l_eye", "r_eye"}, 18, {"val"}),
            "val: val.txt\nnc: 1\nchannels: 18\nnames: [\"person\"]\nkpt_shape: [2, 3]\n"
            "kpt_names: {0: [\"l_eye\",\"r_eye\"]}\nflip_idx: [1,0]\n");
  EXPECT_EQ(yolo_pose_yaml({"a"}, 18, {}).find("flip_idx"), std::string::npos);
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

TEST(FlipIndices, SwapTheSidesUnlessNamesDoNotTell) {
  using Names = std::vector<std::string>;
  using Places = std::vector<int>;
  const std::pair<Names, std::optional<Places>> cases[] = {
      {{"nose", "left_eye", "right_eye"}, Places{0, 2, 1}},
      {{"RKnee", "Root", "LKnee"}, Places{2, 1, 0}},
      {{"r_hip", "l_hip", "head_top"}, Places{1, 0, 2}},
      {{"hip_R", "hip_L"}, Places{1, 0}},
      {{"RKnee", "Root", "LKnee", "Left"}, {}},
      {{}, {}},
      {{"a", "b"}, {}},
      {{"left_eye", "nose"}, {}},
      {{"left_eye", "right_eye", "right_eye"}, {}}};
  for (const auto& [names, places] : cases) EXPECT_EQ(flip_indices(names), places);
}

TEST(CocoBox, IsLeftTopWidthHeight) {
  const Json json = Json::parse(coco_box({7, 5, 2}, {1.5, 2, 4, 8}, true, {}, {9, 9}));
  EXPECT_EQ(json["bbox"], Json({1.5, 2.0, 2.5, 6.0}));
  EXPECT_EQ(json["area"], 15.0);
  EXPECT_EQ(json["iscrowd"], 1);
  EXPECT_EQ(json["id"], 7);
  EXPECT_EQ(json["image_id"], 5);
  EXPECT_EQ(json["category_id"], 2);
  EXPECT_FALSE(json.contains("segmentation"));
}

TEST(CocoBox, PartsArePolygonsAndTheAreaTheirPixels) {
  // The second part covers columns 5 and 6 of row 3; of the first the centres with x + y >= 4.
  const Outline outline{
      {{{4.25, 0}, {4.25, 4}, {0.25, 4}}, {{4.75, 3}, {7, 3}, {7, 4}, {4.75, 4}}}};
  const Json json = Json::parse(coco_box({1, 1, 1}, {0.25, 0, 7, 4}, false, outline, {6, 8}));
  EXPECT_EQ(json["segmentation"],
            Json::parse("[[4.25, 0, 4.25, 4, 0.25, 4], [4.75, 3, 7, 3, 7, 4, 4.75, 4]]"));
  int area = 2;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) area += x + 0.5 + y + 0.5 >= 4.25 ? 1 : 0;
  }
  EXPECT_EQ(json["area"], area);
  EXPECT_EQ(json["bbox"], Json({0.25, 0.0, 6.75, 4.0}));
}

TEST(CocoBox, HolesAndCrowdsAreRunLengths) {
  // Rows ###. / #.#. / ###. in 4 x 3 pixels, down the columns: 3 on, 1 on, 1 off, 4 on, 3 off.
  const Outline holed{{{{0, 0}, {3, 0}, {3, 3}, {0, 3}}, {{1, 1}, {1, 2}, {2, 2}, {2, 1}}}};
  const Json json = Json::parse(coco_box({1, 1, 1}, {0, 0, 3, 3}, false, holed, {3, 4}));
  EXPECT_EQ(json["area"], 8);
  EXPECT_EQ(json["segmentation"]["size"], Json({3, 4}));
  // 0 4 1 4 3, less the one two before from the fourth on: 0 4 1 0 2, each plus 48.
  EXPECT_EQ(json["segmentation"]["counts"], "04102");
  const Outline whole{{holed.rings[0]}};
  EXPECT_TRUE(Json::parse(coco_box({1, 1, 1}, {0, 0, 3, 3}, false, whole, {3, 4}))["segmentation"]
                  .is_array());
  EXPECT_EQ(
      Json::parse(coco_box({1, 1, 1}, {0, 0, 3, 3}, true, whole, {3, 4}))["segmentation"]["counts"],
      "093");  // 0 9 3
}

/// The corners of a line, in pixels; what is wrong with it fails.
std::vector<Point> corners_of(const std::string& line, ImageSize volume) {
  std::istringstream words(line);
  int number = -1;
  words >> number;
  EXPECT_EQ(number, 7);
  std::vector<Point> corners;
  for (double x = 0, y = 0; words >> x >> y;) {
    EXPECT_TRUE(x >= 0 && x <= 1 && y >= 0 && y <= 1) << line;
    corners.push_back({x * volume.width, y * volume.height});
  }
  EXPECT_GE(corners.size(), 3u);
  return corners;
}

/// How many edges lie right of a point: a fill by turns covers it if they are odd.
bool is_odd(const std::vector<Point>& ring, double x, double y) {
  bool odd = false;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Point a = ring[i], b = ring[(i + 1) % ring.size()];
    if ((a.y > y) == (b.y > y)) continue;
    if (a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x) > x) odd = !odd;
  }
  return odd;
}

/// One line covers what the outline does, by turns.
void expect_same_pixels(const Outline& outline, ImageSize volume) {
  const std::vector<Point> ring = corners_of(yolo_outline_line(7, outline, volume), volume);
  const GreyImage mask = mask_of(outline, volume);
  for (int y = 0; y < volume.height; ++y) {
    for (int x = 0; x < volume.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y * volume.width + x);
      ASSERT_EQ(is_odd(ring, x + 0.5, y + 0.5), mask.pixels[at] != 0) << x << " " << y;
    }
  }
}

TEST(YoloOutlineLine, OfOneRingIsItsCornersAsShares) {
  EXPECT_EQ(yolo_outline_line(3, {{{{10, 8}, {30, 8}, {30, 24.00000001}}}}, {24, 40}),
            "3 0.250000000 0.333333333 0.750000000 0.333333333 0.750000000 1.000000000");
}

TEST(YoloOutlineLine, BridgesLeadToPartsAndHolesAndBack) {
  // From (4, 0) to the second square's (6, 0), around it, and back.
  EXPECT_EQ(yolo_outline_line(
                0, {{{{0, 0}, {4, 0}, {4, 4}, {0, 4}}, {{6, 0}, {8, 0}, {8, 4}, {6, 4}}}}, {8, 8}),
            "0 0.000000000 0.000000000 0.500000000 0.000000000 0.750000000 0.000000000 "
            "1.000000000 0.000000000 1.000000000 0.500000000 0.750000000 0.500000000 "
            "0.750000000 0.000000000 0.500000000 0.000000000 0.500000000 0.500000000 "
            "0.000000000 0.500000000");
  expect_same_pixels({{{{1, 1}, {19, 1}, {19, 19}, {1, 19}},
                       {{5, 5}, {5, 9}, {9, 9}, {9, 5}},
                       {{12, 12}, {12, 15}, {15.25, 15}},
                       {{20, 20}, {25, 20}, {25, 25.25}}}},
                     {26, 27});
}

/// Squares clockwise (+1) or the other way (-1), of one ring or of several.
std::vector<Point> square(int direction) {
  std::vector<Point> ring{{0, 0}, {10, 0}, {10, 10}, {0, 10}, {0, 0}};
  if (direction < 0) std::reverse(ring.begin(), ring.end());
  return ring;
}

std::vector<Point> square_twice() {
  std::vector<Point> ring = square(1);
  for (const Point corner : square(1)) ring.push_back(corner);
  return ring;
}

std::vector<Point> pentagram() {
  std::vector<Point> ring;
  for (int i = 0; i < 5; ++i) {
    const double angle = 2 * i * 2 * M_PI / 5;
    ring.push_back({45 + 40 * std::cos(angle), 45 + 40 * std::sin(angle)});
  }
  return ring;
}

TEST(YoloOutlineLine, PartsThatOverlapAreFilledOnceAndRingsThatCancelEachOtherAreNot) {
  expect_same_pixels({{{{1, 1}, {9, 1}, {9, 9}, {1, 9}}, {{5, 5}, {13, 5}, {13, 12}, {5, 12}}}},
                     {14, 15});
  expect_same_pixels({{square_twice()}}, {12, 12});
  expect_same_pixels({{pentagram()}}, {90, 90});
  expect_same_pixels({{square_twice(), square(-1), square(-1)}}, {12, 12});
}

TEST(CocoBox, RingsThatOverlapThemselvesAreRunLengthsAndPartsPolygons) {
  for (const auto& ring : {square_twice(), pentagram()}) {
    const ImageSize size{90, 90};
    const Json json = Json::parse(coco_box({1, 1, 1}, {0, 0, 90, 90}, false, {{ring}}, size));
    const auto runs = run_lengths(json["segmentation"]["counts"].get<std::string>());
    EXPECT_EQ(mask_of(*runs, size), mask_of(Outline{{ring}}, size));
  }
  const Outline outline{{{{0, 0}, {4, 0}, {4, 4}, {0, 4}}, {{2, 2}, {6, 2}, {6, 6}, {2, 6}}}};
  const Json json = Json::parse(coco_box({1, 1, 1}, {0, 0, 6, 6}, false, outline, {6, 6}));
  EXPECT_EQ(json["segmentation"].size(), 2u);
  EXPECT_EQ(json["area"], 16 + 16 - 4);
}

TEST(YoloOutlineLine, CoversWhatAnyMaskDoes) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 30; ++trial) {
    GreyImage mask{{1 + static_cast<int>(random() % 17), 2 + static_cast<int>(random() % 19)}, {}};
    for (std::size_t i = 0; i < mask.size.pixel_count(); ++i) {
      mask.pixels.push_back(random() % 5 < static_cast<unsigned>(trial % 5) ? 1 : 0);
    }
    mask.pixels[0] = 1;
    expect_same_pixels(outline_of(mask), mask.size);
  }
}

TEST(YoloOutlineLine, OfAHundredThousandCornersIsQuick) {
  Outline outline;
  for (const double radius : {400.0, 300.0}) {  // a ring and its hole
    auto& ring = outline.rings.emplace_back();
    for (int i = 0; i < 50'000; ++i) {
      const double angle = (radius > 350 ? 1 : -1) * 2 * M_PI * i / 50'000;
      ring.push_back({450 + radius * std::cos(angle), 450 + radius * std::sin(angle)});
    }
  }
  const auto corners = corners_of(yolo_outline_line(7, outline, {900, 900}), {900, 900});
  EXPECT_EQ(corners.size(), 100'002u);
  EXPECT_TRUE(is_odd(corners, 450 + 350, 450));
  EXPECT_FALSE(is_odd(corners, 450, 450));
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

TEST(CocoCategory, IsNamedAndCountsJointsFromOne) {
  EXPECT_EQ(Json::parse(coco_image(5, "v/a.npy", {60, 80}, "S1/a")), Json::parse(R"({
      "id": 5, "file_name": "v/a.npy", "width": 80, "height": 60, "sample_id": "S1/a"})"));
  const Json json = Json::parse(coco_person_category(1, "person", {"a", "b", "c"}, {{0, 2}}));
  EXPECT_EQ(json["skeleton"], Json::parse("[[1, 3]]"));
  EXPECT_EQ(json["keypoints"], Json({"a", "b", "c"}));
  EXPECT_EQ(Json::parse(coco_category(4, "Car")), (Json{{"id", 4}, {"name", "Car"}}));
}

}  // namespace
}  // namespace eventgan
