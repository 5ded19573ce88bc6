#include "stages/events/pictures/preview_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "stages/events/pictures/skeleton.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::TemporaryFolder;

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

TEST(Skeleton, MpiiIsOneTree) {
  const auto limbs = limbs_of(kMpii);
  EXPECT_EQ(limbs.size(), 15u);  // a tree of 16 joints
  EXPECT_EQ(connected(limbs, 6, 16), 16);
}

TEST(Skeleton, Human36mWith17JointsIsOneTree) {
  for (const auto& names : {kHuman36m17, kHuman36m17Short}) {
    const auto limbs = limbs_of(names);
    EXPECT_EQ(limbs.size(), 16u);
    EXPECT_EQ(connected(limbs, 0, 17), 17);
  }
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

TEST(Skeleton, UnknownNamesHaveNoLimbs) {
  EXPECT_TRUE(limbs_of({}).empty());
  EXPECT_TRUE(limbs_of({"joint 0", "joint 1", "pelvis"}).empty());
}

// 720 / 180 = 4: panels of 720x480 between gaps of 6, below a title of 24.
constexpr ImageSize kDrawnSize{120, 180};
constexpr int kFactor = 4;

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
  content.labels.boxes.push_back({edges, edges, ignore});
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

cv::Mat drawn(const PreviewContent& content) {
  const TemporaryFolder folder;
  write_preview_png(content, folder / "preview.png");
  return cv::imread((folder / "preview.png").string());
}

cv::Mat panel(const cv::Mat& picture, int number) {
  const cv::Size size(kFactor * kDrawnSize.width, kFactor * kDrawnSize.height);
  return picture(cv::Rect({6 + number * (size.width + 6), 24}, size));
}

/// Pixels of a panel that differ from those of the same picture without labels.
cv::Mat labels_only(const PreviewContent& content, int number) {
  PreviewContent bare = content;
  bare.annotation = {};
  bare.labels = {};
  cv::Mat difference;
  cv::absdiff(panel(drawn(content), number), panel(drawn(bare), number), difference);
  cv::cvtColor(difference, difference, cv::COLOR_BGR2GRAY);
  return difference > 20;
}

int brightness(const cv::Mat& picture, int x, int y) {
  const cv::Vec3b pixel = picture.at<cv::Vec3b>(y, x);
  return std::max({pixel[0], pixel[1], pixel[2]});
}

TEST(PreviewPicture, ThreePanelsBesideEachOther) {
  const cv::Mat picture = drawn(content_with(90));
  EXPECT_EQ(picture.size(), cv::Size(3 * 720 + 4 * 6, 24 + 480 + 20));
  EXPECT_EQ(panel(picture, 0).at<cv::Vec3b>(10, 10), cv::Vec3b(90, 90, 90));
  EXPECT_EQ(panel(picture, 1).at<cv::Vec3b>(479, 719), cv::Vec3b(90, 90, 90));
  EXPECT_EQ(cv::countNonZero(panel(picture, 2).reshape(1)), 0) << "no events are black";
}

TEST(PreviewPicture, ABoxStandsAtItsPlaceInAllPanels) {
  PreviewContent content = content_with(90);
  add_box(content, {40, 50, 90, 80}, /*ignore=*/false);
  for (int number = 0; number < 3; ++number) {
    const cv::Mat marks = labels_only(content, number);
    // Below the caption: the lines run along edges x 4, two pixels wide with softened borders.
    const cv::Rect bounds = cv::boundingRect(marks.rowRange(4 * 50 - 2, 480));
    EXPECT_NEAR(bounds.x, 4 * 40, 3);
    EXPECT_NEAR(bounds.x + bounds.width, 4 * 90, 3);
    EXPECT_NEAR(bounds.y + bounds.height + 4 * 50 - 2, 4 * 80, 3);
    EXPECT_EQ(marks.at<std::uint8_t>(4 * 65, 4 * 65), 0) << "the inside stays free";
    EXPECT_GT(cv::countNonZero(marks.rowRange(0, 4 * 50 - 2)), 0) << "the caption stands above";
  }
}

TEST(PreviewPicture, ABoxThatFillsTheVolumeShowsAllFourSides) {
  PreviewContent content = content_with(90);
  add_box(content, {0, 0, 180, 120}, /*ignore=*/false);
  const cv::Rect bounds = cv::boundingRect(labels_only(content, 0));
  EXPECT_EQ(bounds, cv::Rect(0, 0, 720, 480));
}

TEST(PreviewPicture, IgnoredRegionsAreDashedAndGrey) {
  PreviewContent content = content_with(20);
  add_box(content, {40, 50, 90, 80}, /*ignore=*/true);
  const cv::Mat picture = panel(drawn(content), 0);
  int on = 0;
  int off = 0;
  for (int x = 4 * 40; x < 4 * 90; ++x) {
    const cv::Vec3b pixel = picture.at<cv::Vec3b>(4 * 50, x);
    EXPECT_EQ(pixel[0], pixel[2]) << "coloured at " << x;
    ++(pixel[0] > 40 ? on : off);
  }
  EXPECT_NEAR(on, off, 0.3 * (on + off));
}

TEST(PreviewPicture, JointsStandAtTheirPlaceAndHiddenOnesAreHollow) {
  PreviewContent content = content_with(90);
  add_person(content, {{{30, 30}, 1}, {{100, 60}, 0}, {kMissingPoint, 0}});
  content.schema.joint_names = {"a", "b", "c"};
  for (int number = 0; number < 3; ++number) {
    const cv::Mat marks = labels_only(content, number);
    // Volume pixel 30 is panel pixels 120..123.
    EXPECT_NE(marks.at<std::uint8_t>(121, 121), 0);
    const cv::Mat picture = panel(drawn(content), number);
    EXPECT_GT(brightness(picture, 121, 121), 200);
    EXPECT_LT(brightness(picture, 4 * 100 + 1, 4 * 60 + 1), 20) << "hollow";
    EXPECT_GT(brightness(picture, 4 * 100 + 1 + 4, 4 * 60 + 1), 100) << "its ring";
    EXPECT_EQ(cv::countNonZero(marks(cv::Rect(0, 0, 60, 60))), 0) << "the missing joint";
  }
}

TEST(PreviewPicture, LimbsJoinKnownJointsOnly) {
  PreviewContent content = content_with(90);
  content.schema.joint_names = {"r_ankle", "r_knee", "r_hip"};
  add_person(content, {{{20, 60}, 1}, {{120, 60}, 1}, {kMissingPoint, 0}});
  const cv::Mat marks = labels_only(content, 0);
  EXPECT_NE(marks.at<std::uint8_t>(4 * 60 + 1, 4 * 70), 0) << "shin";
  EXPECT_EQ(cv::countNonZero(marks(cv::Rect(0, 0, 60, 60))), 0) << "no thigh towards (-1, -1)";
}

TEST(PreviewPicture, FarAwayLabelsDoNoHarm) {
  PreviewContent content = content_with(90);
  add_person(content, {{{1e12, -1e12}, 1}, {{20, 20}, 1}});
  content.schema.joint_names = {"r_ankle", "r_knee"};
  add_box(content, {-5, -5, -5, -5}, false);
  EXPECT_NO_THROW(drawn(content));
}

TEST(PreviewPicture, WhatIsMissingIsSaid) {
  PreviewContent content = content_with(90);
  content.previous_bgr.clear();
  content.volume.clear();
  const cv::Mat picture = drawn(content);
  for (const int number : {0, 2}) {
    cv::Mat grey;
    cv::cvtColor(panel(picture, number), grey, cv::COLOR_BGR2GRAY);
    EXPECT_GT(cv::countNonZero(grey > 150), 100) << "text in panel " << number;
  }
}

TEST(PreviewPicture, LongTitlesAreCut) {
  PreviewContent content = content_with(90);
  content.title.assign(2000, 'W');
  const cv::Mat picture = drawn(content);
  EXPECT_EQ(picture.at<cv::Vec3b>(12, picture.cols - 2), picture.at<cv::Vec3b>(1, 1));
}

TEST(PreviewPicture, ErrorsNameThePath) {
  const TemporaryFolder folder;
  try {
    write_preview_png(content_with(90), folder / "none/preview.png");
    FAIL() << "expected an exception";
  } catch (const std::runtime_error& error) {
    // Of the temporary file that it is first.
    EXPECT_THAT(error.what(), ::testing::HasSubstr((folder / "none/.preview.png").string()));
  }
}

TEST(PreviewPicture, SizesThatDifferAreRefused) {
  PreviewContent content = content_with(90);
  content.next_bgr.pop_back();
  EXPECT_THROW(drawn(content), std::invalid_argument);
  content = content_with(90);
  content.annotation.boxes.resize(1);
  EXPECT_THROW(drawn(content), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
