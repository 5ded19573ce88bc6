#include "stages/frames/human36m/human36m_joints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/testing/shared_data.h"

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

TEST(Human36mJointsTest, SeventeenNamesAreThoseOfTheCocoList) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  std::ifstream stream(data / "human36m_lists" / "h36m_coco.json");
  const auto list = nlohmann::json::parse(stream);
  EXPECT_EQ(human36m_joint_names(17),
            list["categories"][0]["keypoints"].get<std::vector<std::string>>());
}

}  // namespace
}  // namespace eventgan
