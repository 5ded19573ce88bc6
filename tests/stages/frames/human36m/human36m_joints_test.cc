#include "stages/frames/human36m/human36m_joints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace eventgan {
namespace {

TEST(Human36mJointsTest, NamesAreDistinctAndAsManyAsAsked) {
  for (const std::size_t count : {0u, 1u, 17u, 24u, 32u}) {
    const auto names = human36m_joint_names(count);
    EXPECT_EQ(names.size(), count);
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), count);
  }
  EXPECT_THAT(human36m_joint_names(2), ::testing::ElementsAre("joint_0", "joint_1"));
}

TEST(Human36mJointsTest, ThirtyTwoJointsHoldTheUsualSeventeenWhereTrainersTakeThem) {
  const auto names = human36m_joint_names(32);
  // The choice every trainer makes: 0 1 2 3 6 7 8 12 13 14 15 17 18 19 25 26 27.
  EXPECT_EQ(names[3], "RightFoot");
  EXPECT_EQ(names[8], "LeftFoot");
  EXPECT_EQ(names[12], "Spine1");
  EXPECT_EQ(names[15], "Head_Site");
  EXPECT_EQ(names[19], "LeftHand");
  EXPECT_EQ(names[27], "RightHand");
}

TEST(Human36mJointsTest, SeventeenJointsHaveTheSidesOfThoseAmongTheThirtyTwo) {
  const auto all = human36m_joint_names(32);
  const auto chosen = human36m_joint_names(17);
  const std::vector<std::size_t> choice = {0,  1,  2,  3,  6,  7,  8,  12, 13,
                                           14, 15, 17, 18, 19, 25, 26, 27};
  for (std::size_t i = 0; i < choice.size(); ++i) {
    EXPECT_EQ(chosen[i].starts_with("right"), all[choice[i]].starts_with("Right")) << i;
    EXPECT_EQ(chosen[i].starts_with("left"), all[choice[i]].starts_with("Left")) << i;
  }
  EXPECT_EQ(chosen[1], "right_hip");
  EXPECT_EQ(chosen[6], "left_foot");
}

}  // namespace
}  // namespace eventgan
