#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/frames/mpii/mpii_list_row_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A row whose sixteen joints are all (5, 6) and visible but for joint 3.
Json row_with(MpiiListForm form, const Json& joint3, const Json& visible3) {
  Json joints = Json::array(), visible = Json::array();
  for (int i = 0; i < 16; ++i) {
    joints.push_back(i == 3 ? joint3 : Json{5, 6});
    visible.push_back(i == 3 ? visible3 : Json(1));
  }
  const bool is_table = form == MpiiListForm::kTable;
  return {{image_field(form), "a.jpg"},
          {"center", {966.0, 340.5}},
          {"scale", 4.7},
          {is_table ? "part" : "joints", joints},
          {is_table ? "visible" : "joints_vis", visible}};
}

TEST(MpiiListRow, EveryCoordinateLosesOne) {
  for (const auto form : {MpiiListForm::kJsonList, MpiiListForm::kTable}) {
    const Person person = parse_mpii_list_row(row_with(form, {10.5, 0.5}, 0), form);
    ASSERT_EQ(person.joints.size(), 16u);
    EXPECT_EQ(person.joints[0], (Joint{{4, 5}, 1}));
    EXPECT_EQ(person.joints[3], (Joint{{9.5, -0.5}, 0}));
    EXPECT_EQ(person.center, (Point{965, 339.5}));
    EXPECT_EQ(person.scale, 4.7);
    EXPECT_FALSE(person.head_box);
  }
}

TEST(MpiiListRow, EachFormMarksMissingJointsItsOwnWay) {
  const Joint missing{kMissingPoint, 0};
  const auto joint3 = [](MpiiListForm form, const Json& at) {
    return parse_mpii_list_row(row_with(form, at, 0), form).joints[3];
  };
  EXPECT_EQ(joint3(MpiiListForm::kJsonList, {-1.0, -1.0}), missing);
  EXPECT_EQ(joint3(MpiiListForm::kTable, {0.0, 0.0}), missing);
  // What marks a missing joint in one form is a place in the other; so is a zero in one coordinate.
  EXPECT_EQ(joint3(MpiiListForm::kTable, {-1.0, -1.0}).at, (Point{-2, -2}));
  EXPECT_EQ(joint3(MpiiListForm::kTable, {325.0, 0.0}).at, (Point{324, -1}));
}

TEST(MpiiListRow, AMissingJointIsNeverVisible) {
  const auto form = MpiiListForm::kTable;
  EXPECT_EQ(parse_mpii_list_row(row_with(form, {0, 0}, 1), form).joints[3],
            (Joint{kMissingPoint, 0}));
}

TEST(MpiiListRow, TestImagesHaveNoJoints) {
  const Person person = parse_mpii_list_row(
      {{"image", "a.jpg"}, {"center", {-1, -1}}, {"scale", -1}}, MpiiListForm::kJsonList);
  EXPECT_EQ(person.joints, std::vector<Joint>(16, Joint{kMissingPoint, 0}));
  EXPECT_EQ(person.center, kMissingPoint);
  EXPECT_EQ(person.scale, -1);
}

TEST(MpiiListRow, JointsWithoutVisibilityAreOfUnknownVisibility) {
  Json row = row_with(MpiiListForm::kJsonList, {-1, -1}, 0);
  row.erase("joints_vis");
  const Person person = parse_mpii_list_row(row, MpiiListForm::kJsonList);
  EXPECT_EQ(person.joints[0].visible, -1);
  EXPECT_EQ(person.joints[3].visible, 0);
}

TEST(MpiiListRow, RefusesMalformedRows) {
  const auto form = MpiiListForm::kJsonList;
  const auto expect_refused = [&](const Json& row, const char* message) {
    EXPECT_THAT([&] { parse_mpii_list_row(row, form); },
                ThrowsMessage<std::invalid_argument>(HasSubstr(message)));
  };
  expect_refused(row_with(form, {1, nullptr}, 1),
                 "expected two finite numbers, got [1,null] at joints[3]");
  expect_refused(row_with(form, {1, 2, 3}, 1), "expected two finite numbers");
  expect_refused(row_with(form, {1, 2}, 0.5), "expected 0 or 1, got 0.5 at joints_vis[3]");
  Json row = row_with(form, {1, 2}, 1);
  row["joints"].erase(0);
  expect_refused(row, "expected 16 elements");
  row = row_with(form, {1, 2}, 1);
  row["joints_vis"] = 1;
  expect_refused(row, "expected 16 elements, got 1 at joints_vis");
  row = row_with(form, {1, 2}, 1);
  row["scale"] = "4";
  expect_refused(row, "expected a finite number, got \"4\" at scale");
  row["scale"] = 4;
  row["center"] = 7;
  expect_refused(row, "expected two finite numbers, got 7 at center");
}

}  // namespace
}  // namespace eventgan
