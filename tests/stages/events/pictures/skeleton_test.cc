#include "stages/events/pictures/skeleton.h"

#include <gtest/gtest.h>

#include <numeric>

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

}  // namespace
}  // namespace eventgan
