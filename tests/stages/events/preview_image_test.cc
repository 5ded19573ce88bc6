#include "stages/events/images/preview_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "stages/events/images/skeleton.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

const std::vector<std::string> kMpii{"r_ankle",    "r_knee",     "r_hip",   "l_hip",
                                     "l_knee",     "l_ankle",    "pelvis",  "thorax",
                                     "upper_neck", "head_top",   "r_wrist", "r_elbow",
                                     "r_shoulder", "l_shoulder", "l_elbow", "l_wrist"};

// The two ways in which Human3.6M's 17 joints are named.
const std::vector<std::string> kHuman36m17{
    "root (pelvis)", "right_hip",  "right_knee",     "right_foot",  "left_hip",   "left_knee",
    "left_foot",     "spine",      "thorax",         "neck_base",   "head",       "left_shoulder",
    "left_elbow",    "left_wrist", "right_shoulder", "right_elbow", "right_wrist"};
const std::vector<std::string> kHuman36m17Short{
    "Hip",       "RHip", "RKnee",     "RFoot",  "LHip",   "LKnee",     "LFoot",  "Spine", "Thorax",
    "Neck/Nose", "Head", "LShoulder", "LElbow", "LWrist", "RShoulder", "RElbow", "RWrist"};

const std::vector<std::string> kHuman36m32{"Hips",
                                           "RightUpLeg",
                                           "RightLeg",
                                           "RightFoot",
                                           "RightToeBase",
                                           "RightToeBase_Site",
                                           "LeftUpLeg",
                                           "LeftLeg",
                                           "LeftFoot",
                                           "LeftToeBase",
                                           "LeftToeBase_Site",
                                           "Spine",
                                           "Spine1",
                                           "Neck",
                                           "Head",
                                           "Head_Site",
                                           "LeftShoulder",
                                           "LeftArm",
                                           "LeftForeArm",
                                           "LeftHand",
                                           "LeftHandThumb",
                                           "LeftHandThumb_Site",
                                           "L_Wrist_End",
                                           "L_Wrist_End_Site",
                                           "RightShoulder",
                                           "RightArm",
                                           "RightForeArm",
                                           "RightHand",
                                           "RightHandThumb",
                                           "RightHandThumb_Site",
                                           "R_Wrist_End",
                                           "R_Wrist_End_Site"};

/// Number of joints that hang together with joint `from`.
int connected(const std::vector<Limb>& limbs, int from, std::size_t joints) {
  std::vector<bool> reached(joints, false);
  reached[from] = true;
  for (std::size_t round = 0; round < joints; ++round) {
    for (const Limb& limb : limbs) {
      if (reached[limb.from] || reached[limb.to]) reached[limb.from] = reached[limb.to] = true;
    }
  }
  return std::accumulate(reached.begin(), reached.end(), 0);
}

TEST(Skeleton, OfKnownNamesIsOneTree) {
  EXPECT_EQ(limbs_of(kMpii).size(), 15u);  // a tree of 16 joints
  EXPECT_EQ(connected(limbs_of(kMpii), 6, 16), 16);
  for (const auto& names : {kHuman36m17, kHuman36m17Short}) {
    const auto limbs = limbs_of(names);
    EXPECT_EQ(limbs.size(), 16u);
    EXPECT_EQ(connected(limbs, 0, 17), 17);
  }
  EXPECT_TRUE(limbs_of({}).empty());
  EXPECT_TRUE(limbs_of({"joint 0", "joint 1", "pelvis"}).empty());
}

TEST(Skeleton, Human36mWith32JointsHasToesAndCollarbones) {
  const auto limbs = limbs_of(kHuman36m32);
  // Middle: hips, spine, spine1, neck, head, head site = 5 limbs; legs to the toes 2 x 4; neck,
  // collarbone, arm, forearm, hand 2 x 4. So 22 joints hang together; thumbs, wrist ends and toe
  // sites have no limb.
  EXPECT_EQ(limbs.size(), 21u);
  EXPECT_EQ(connected(limbs, 0, 32), 22);
}

TEST(Skeleton, SidesAreThePersonsOwn) {
  for (const Limb& limb : limbs_of(kMpii)) {
    const std::string& to = kMpii[limb.to];
    const BodySide expected = to.starts_with("r_")   ? BodySide::kRight
                              : to.starts_with("l_") ? BodySide::kLeft
                                                     : BodySide::kMiddle;
    EXPECT_EQ(limb.side, expected) << to;
  }
}

// Stacked, four times as large: side by side they could be three times, (1420 - 18) / 2 / 180.
constexpr ImageSize kDrawnSize{82, 180};
constexpr int kFactor = 4;
constexpr int kPanelHeight = kFactor * kDrawnSize.height;

PreviewContent content_with(std::uint8_t grey) {
  PreviewContent content;
  content.shape = {9, kDrawnSize};
  content.previous_bgr.assign(3 * kDrawnSize.pixel_count(), grey);
  content.next_bgr.assign(3 * kDrawnSize.pixel_count(), grey);
  content.volume.assign(content.shape.value_count(), 0.0f);
  content.title = "a title";
  return content;
}

void add_box(PreviewContent& content, const Rectangle& edges, bool ignore) {
  Box box;
  box.xyxy = edges;
  box.ignore = ignore;
  content.annotation.boxes.push_back(box);
  content.labels.boxes.push_back({edges, edges, ignore, {}});
  content.schema.class_names = {"Car"};
}

void add_person(PreviewContent& content, const std::vector<Joint>& joints) {
  Person person;
  VolumePerson placed;
  person.joints = joints;
  for (const Joint& joint : joints) placed.joints.push_back(joint.at);
  content.annotation.persons.push_back(person);
  content.labels.persons.push_back(placed);
}

/// The image's pixels, of its own.
cv::Mat pixels_of(const ColourFrame& image) {
  return cv::Mat(image.size.height, image.size.width, CV_8UC3,
                 const_cast<std::uint8_t*>(image.bgr.data()))
      .clone();
}

cv::Mat drawn(const PreviewContent& content) { return pixels_of(draw_preview(content)); }

cv::Mat panel(const cv::Mat& image, int number) {
  const cv::Size size(kFactor * kDrawnSize.width, kPanelHeight);
  return image(cv::Rect({6, 24 + number * (size.height + 20)}, size));
}

/// Pixels of a panel that differ from those of the same image without labels.
cv::Mat labels_only(const PreviewContent& content, int number) {
  PreviewContent bare = content;
  bare.annotation = {};
  bare.labels = {};
  cv::Mat difference;
  cv::absdiff(panel(drawn(content), number), panel(drawn(bare), number), difference);
  cv::cvtColor(difference, difference, cv::COLOR_BGR2GRAY);
  return difference > 20;
}

int brightness(const cv::Mat& image, int x, int y) {
  const cv::Vec3b pixel = image.at<cv::Vec3b>(y, x);
  return std::max({pixel[0], pixel[1], pixel[2]});
}

TEST(PreviewImage, FourPanels) {
  const cv::Mat image = drawn(content_with(90));
  EXPECT_EQ(image.size(), cv::Size(720 + 2 * 6, 24 + 4 * (328 + 20)));
  EXPECT_EQ(panel(image, 0).at<cv::Vec3b>(10, 10), cv::Vec3b(90, 90, 90));
  EXPECT_EQ(panel(image, 1).at<cv::Vec3b>(327, 719), cv::Vec3b(90, 90, 90));
  EXPECT_EQ(cv::countNonZero(panel(image, 2).reshape(1)), 0) << "no events are black";
  EXPECT_EQ(cv::countNonZero(panel(image, 3).reshape(1) != 255), 0) << "or white";
}

TEST(PreviewImage, FlowIsArrowsOnTheLabelledFrame) {
  const std::size_t pixels = kDrawnSize.pixel_count();
  for (const int labelled : {0, 1}) {
    PreviewContent content = content_with(90);
    content.label_position = labelled;
    const cv::Mat without = drawn(content);
    // All moves 4 to the right: red arrows from one frame's place to the other's.
    content.flow = {std::vector<float>(2 * pixels), std::vector<std::uint8_t>(pixels, 1)};
    std::fill_n(content.flow.px.begin(), pixels, 4.0f);
    for (int y = 0; y < kDrawnSize.height / 2; ++y) {
      std::fill_n(content.flow.valid.begin() + y * kDrawnSize.width, kDrawnSize.width, 0);
    }
    const cv::Mat with = drawn(content);
    for (const int number : {0, 1, 2, 3}) {
      cv::Mat difference;
      cv::absdiff(panel(with, number), panel(without, number), difference);
      const int upper = kPanelHeight / 2 - 8;
      EXPECT_EQ(cv::countNonZero(difference.rowRange(0, upper).clone().reshape(1)), 0) << number;
      EXPECT_EQ(cv::countNonZero(difference.reshape(1)) > 0, number == labelled) << number;
    }
    // The first arrow of the valid half begins or ends at (2, 42), which is drawn at 4 (2.5, 42.5).
    const cv::Vec3b on_it = panel(with, labelled).at<cv::Vec3b>(4 * 42 + 2, 4 * (labelled ? 7 : 9));
    EXPECT_GT(on_it[2], on_it[0] + 60);
  }
}

/// So that they are seen on the colours of times and on white.
TEST(PreviewImage, BoxesAreMagentaOrWhiteWithADarkEdge) {
  PreviewContent content = content_with(90);
  add_box(content, {40, 30, 70, 70}, /*ignore=*/false);
  add_box(content, {100, 30, 130, 70}, /*ignore=*/false);
  content.annotation.boxes[1].class_id = 1;
  for (int number = 1; number < 4; ++number) {
    const cv::Mat image = panel(drawn(content), number);
    EXPECT_EQ(image.at<cv::Vec3b>(4 * 50, 4 * 40), cv::Vec3b(255, 60, 255));
    EXPECT_EQ(image.at<cv::Vec3b>(4 * 50, 4 * 100), cv::Vec3b(255, 255, 255));
    for (const int x : {4 * 40, 4 * 100}) {
      cv::Mat around;
      cv::cvtColor(image(cv::Rect(x - 4, 4 * 50, 9, 1)), around, cv::COLOR_BGR2GRAY);
      EXPECT_GE(cv::countNonZero(around < 110), 2) << "at " << x << " in panel " << number;
    }
  }
}

TEST(PreviewImage, ABoxStandsAtItsPlace) {
  PreviewContent content = content_with(90);
  add_box(content, {40, 50, 90, 80}, /*ignore=*/false);
  for (int number = 0; number < 4; ++number) {
    const cv::Mat marks = labels_only(content, number);
    // Below the caption: the lines run along edges x 4, with their edges four pixels wide,
    // softened.
    const cv::Rect bounds = cv::boundingRect(marks.rowRange(4 * 50 - 4, kPanelHeight));
    EXPECT_NEAR(bounds.x, 4 * 40, 4);
    EXPECT_NEAR(bounds.x + bounds.width, 4 * 90, 4);
    EXPECT_NEAR(bounds.y + bounds.height + 4 * 50 - 4, 4 * 80, 4);
    EXPECT_EQ(marks.at<std::uint8_t>(4 * 65, 4 * 65), 0) << "the inside stays free";
    EXPECT_EQ(cv::countNonZero(marks.rowRange(0, 4 * 50 - 4)) > 0, number > 0)
        << "the caption is above, where the label belongs";
  }
}

TEST(PreviewImage, AnOutlineIsDrawnWhereTheLabelBelongs) {
  PreviewContent content = content_with(90);
  for (const bool ignore : {false, true}) {
    add_box(content, {40, 50, 90, 80}, ignore);
    content.labels.boxes.back().outline = {{{{50, 60}, {80, 60}, {80, 75}, {50, 75}}}};
    for (int number = 0; number < 4; ++number) {
      const cv::Mat marks = labels_only(content, number);
      for (const cv::Point edge : {cv::Point(65, 60), {80, 67}, {65, 75}, {50, 67}}) {
        const cv::Rect around(4 * edge.x - 2, 4 * edge.y - 2, 5, 5);
        EXPECT_EQ(cv::countNonZero(marks(around)) > 0, number > 0) << edge;
      }
      EXPECT_EQ(cv::countNonZero(marks(cv::Rect(4 * 52, 4 * 62, 4 * 26, 4 * 11))), 0);
    }
    content.annotation.boxes.clear();
    content.labels.boxes.clear();
  }
}

TEST(PreviewImage, OutlinesOfAnySizeAreDrawn) {
  PreviewContent content = content_with(90);
  add_box(content, {40, 50, 90, 80}, /*ignore=*/false);
  auto& ring = content.labels.boxes[0].outline.rings.emplace_back();
  for (int i = 0; i < 100'000; ++i) {
    const double angle = 2 * M_PI * i / 100'000;
    ring.push_back({65 + 1e6 * std::cos(angle), 65 + 10 * std::sin(angle)});
  }
  EXPECT_GT(cv::countNonZero(labels_only(content, 2)), 0);
}

TEST(PreviewImage, TheLabelledFrameIsMarkedAndTheOtherHasThinDashes) {
  PreviewContent content = content_with(90);
  add_box(content, {40, 50, 90, 80}, /*ignore=*/false);
  const auto marked = [&](int number) {
    return cv::countNonZero(labels_only(content, number)(cv::Rect(4 * 40 - 3, 4 * 55, 7, 80)));
  };
  const auto border = [&](int number) {
    const cv::Vec3b pixel = drawn(content).at<cv::Vec3b>(24 + number * 348 + 100, 4);
    return pixel[2] > 200;
  };
  for (const int labelled : {0, 1}) {
    content.label_position = labelled;
    EXPECT_GE(marked(labelled), 2 * 80) << "a whole line of two pixels";
    EXPECT_GE(marked(1 - labelled), 20);
    EXPECT_LE(marked(1 - labelled), 80) << "dashes of one";
    EXPECT_TRUE(border(labelled));
    EXPECT_FALSE(border(1 - labelled));
  }
  content.label_position = 0.5;
  for (const int frame : {0, 1}) {
    EXPECT_LE(marked(frame), 80);
    EXPECT_FALSE(border(frame));
  }
  for (const int events : {2, 3}) {
    EXPECT_GE(marked(events), 2 * 80) << "the events have the labels always";
  }
}

TEST(PreviewImage, NamesDoNotHideSmallBoxes) {
  PreviewContent content = content_with(90);
  // Below one another, so that a name above the lower box would hide the upper one.
  add_box(content, {40, 50, 45, 53}, false);
  add_box(content, {40, 54, 45, 57}, false);
  const cv::Mat image = panel(drawn(content), 1);
  for (const int top : {50, 54}) {
    const cv::Rect inside(4 * 40 + 4, 4 * top + 4, 10, 3);
    cv::Mat distance;
    cv::absdiff(image(inside), cv::Scalar::all(90), distance);
    EXPECT_EQ(cv::countNonZero(distance.reshape(1)), 0) << top;
  }
  content.annotation.boxes.clear();
  content.labels.boxes.clear();
  for (int i = 0; i < 560; ++i) {  // one beside the other, smaller than a name: none has room
    const double left = 4.5 * (i % 40), top = 5.5 * (i / 40);
    add_box(content, {left, top, left + 4.5, top + 5.5}, false);
  }
  EXPECT_EQ(panel(drawn(content), 1).at<cv::Vec3b>(4 * 55 + 11, 4 * 45 + 9), cv::Vec3b(90, 90, 90));
}

TEST(PreviewImage, ATileHasTheLabelledFrameAndTheEvents) {
  PreviewContent content;
  content.shape = {9, {110, 180}};
  content.previous_bgr.assign(3 * content.shape.size.pixel_count(), 90);
  content.next_bgr.assign(3 * content.shape.size.pixel_count(), 200);
  content.volume.assign(content.shape.value_count(), 0.0f);
  cv::Mat tile = pixels_of(draw_tile(content, 378));
  EXPECT_EQ(tile.size(), cv::Size(378, 24 + 110 + 6)) << "(378 - 18) / 2 = 180";
  EXPECT_EQ(tile.at<cv::Vec3b>(60, 60), cv::Vec3b(200, 200, 200));
  EXPECT_EQ(tile.at<cv::Vec3b>(60, 300), cv::Vec3b(0, 0, 0));
  content.label_position = 0;
  EXPECT_EQ(pixels_of(draw_tile(content, 378)).at<cv::Vec3b>(60, 60), cv::Vec3b(90, 90, 90));

  // A name stands above a box that is as wide, 30 rows below the panel's first.
  const auto has_name = [&](const Rectangle& edges) {
    PreviewContent labelled = content;
    add_box(labelled, edges, /*ignore=*/false);
    const cv::Rect above(static_cast<int>(6 + edges.left), 24 + 30 - 8, 10, 4);
    return cv::countNonZero(pixels_of(draw_tile(labelled, 378))(above).clone().reshape(1) != 90) >
           0;
  };
  EXPECT_TRUE(has_name({80, 30, 140, 70}));
  EXPECT_FALSE(has_name({80, 30, 88, 70}));

  PreviewContent wide;
  wide.shape = {9, {10, 100}};
  tile = pixels_of(draw_tile(wide, 112));
  EXPECT_EQ(tile.size(), cv::Size(112, 24 + 2 * (10 + 6))) << "one above the other";
}

TEST(PreviewImage, ASheetHasRowsOfTiles) {
  const auto tile = [](int height, std::uint8_t grey) {
    return ColourFrame{{height, 10}, std::vector<std::uint8_t>(std::size_t(30 * height), grey)};
  };
  const std::vector<ColourFrame> tiles{tile(20, 50), tile(30, 100), tile(5, 150)};
  const cv::Mat sheet = pixels_of(draw_sheet(tiles, 2));
  EXPECT_EQ(sheet.size(), cv::Size(20, 35));
  EXPECT_EQ(sheet.at<cv::Vec3b>(19, 9)[0], 50);
  EXPECT_EQ(sheet.at<cv::Vec3b>(29, 10)[0], 100);
  EXPECT_EQ(sheet.at<cv::Vec3b>(34, 0)[0], 150);
  EXPECT_THROWS(draw_sheet({}, 2), std::invalid_argument, "expected tiles, got none");
}

TEST(PreviewImage, ABoxThatFillsTheVolumeShowsAllFourSides) {
  PreviewContent content = content_with(90);
  add_box(content, {0, 0, 180, 82}, /*ignore=*/false);
  const cv::Rect bounds = cv::boundingRect(labels_only(content, 1));
  EXPECT_EQ(bounds, cv::Rect(0, 0, 720, 328));
}

TEST(PreviewImage, IgnoredRegionsAreDashedAndGrey) {
  PreviewContent content = content_with(20);
  add_box(content, {40, 50, 90, 80}, /*ignore=*/true);
  const cv::Mat image = panel(drawn(content), 1);
  int on = 0;
  int off = 0;
  for (int x = 4 * 40; x < 4 * 90; ++x) {
    const cv::Vec3b pixel = image.at<cv::Vec3b>(4 * 50, x);
    EXPECT_EQ(pixel[0], pixel[2]) << "coloured at " << x;
    ++(pixel[0] > 40 ? on : off);
  }
  EXPECT_NEAR(on, off, 0.3 * (on + off));
}

TEST(PreviewImage, JointsStandAtTheirPlaceAndHiddenOnesAreHollow) {
  PreviewContent content = content_with(90);
  add_person(content, {{{30, 30}, 1}, {{100, 60}, 0}, {kMissingPoint, 0}});
  content.schema.joint_names = {"a", "b", "c"};
  for (const int number : {1, 2}) {
    const cv::Mat marks = labels_only(content, number);
    // Volume pixel 30 is panel pixels 120..123.
    EXPECT_NE(marks.at<std::uint8_t>(121, 121), 0);
    const cv::Mat image = panel(drawn(content), number);
    EXPECT_GT(brightness(image, 121, 121), 200);
    EXPECT_LT(brightness(image, 4 * 100 + 1, 4 * 60 + 1), 20) << "hollow";
    EXPECT_GT(brightness(image, 4 * 100 + 1 + 4, 4 * 60 + 1), 100) << "its ring";
    EXPECT_EQ(cv::countNonZero(marks(cv::Rect(0, 0, 60, 60))), 0) << "the missing joint";
  }
}

TEST(PreviewImage, LimbsJoinKnownJointsAndFarLabelsDoNoHarm) {
  PreviewContent content = content_with(90);
  content.schema.joint_names = {"r_ankle", "r_knee", "r_hip"};
  add_person(content, {{{20, 60}, 1}, {{120, 60}, 1}, {kMissingPoint, 0}});
  const cv::Mat marks = labels_only(content, 1);
  EXPECT_NE(marks.at<std::uint8_t>(4 * 60 + 1, 4 * 70), 0) << "shin";
  EXPECT_EQ(cv::countNonZero(marks(cv::Rect(0, 0, 60, 60))), 0) << "no thigh towards (-1, -1)";
  content = content_with(90);
  add_person(content, {{{1e12, -1e12}, 1}, {{20, 20}, 1}});
  content.schema.joint_names = {"r_ankle", "r_knee"};
  add_box(content, {-5, -5, -5, -5}, false);
  EXPECT_NO_THROW(drawn(content));
}

TEST(PreviewImage, WhatIsMissingIsSaid) {
  PreviewContent content = content_with(90);
  content.previous_bgr.clear();
  content.volume.clear();
  const cv::Mat image = drawn(content);
  for (const int number : {0, 2, 3}) {
    cv::Mat grey;
    cv::cvtColor(panel(image, number), grey, cv::COLOR_BGR2GRAY);
    EXPECT_GT(cv::countNonZero(grey > 150), 100) << "text in panel " << number;
  }
}

TEST(PreviewImage, LongTitlesAreCutAndSizesThatDifferAreRefused) {
  PreviewContent content = content_with(90);
  content.title.assign(2000, 'W');
  const cv::Mat image = drawn(content);
  EXPECT_EQ(image.at<cv::Vec3b>(12, image.cols - 2), image.at<cv::Vec3b>(1, 1));
  content = content_with(90);
  content.next_bgr.pop_back();
  EXPECT_THROWS(drawn(content), std::invalid_argument,
                "expected frames, volume and labels of one sample, got sizes");
  content = content_with(90);
  content.annotation.boxes.resize(1);
  EXPECT_THROWS(drawn(content), std::invalid_argument,
                "expected frames, volume and labels of one sample, got sizes");
}

}  // namespace
}  // namespace eventgan
