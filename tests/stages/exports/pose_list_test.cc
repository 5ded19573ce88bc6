#include "stages/exports/pose_list.h"

#include <gtest/gtest.h>
#include <matio.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using Json = nlohmann::json;

TEST(ChooseJoints, TakesAllOrThoseWithCommonNames) {
  const JointChoice all = choose_joints({{}, {"a", "b"}, {}});
  EXPECT_EQ(all.indices, (std::vector<std::size_t>{0, 1}));
  EXPECT_EQ(all.names, (std::vector<std::string>{"a", "b"}));
  const JointChoice some = choose_joints({{}, {"Hips", "Toe", "Head"}, {"root", "", "head"}});
  EXPECT_EQ(some.indices, (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(some.names, (std::vector<std::string>{"root", "head"}));
}

class ListedPersonTest : public ::testing::Test {
 protected:
  ListedPersonTest() {
    person_.joints = {{3, 4}, kMissingPoint, {5, 6}};
    person_.center = {10, 20};
    person_.scale = 0.5;
  }
  VolumePerson person_;
  JointChoice choice_ = choose_joints({{}, {"upper_neck", "pelvis", "head_top"}, {}});
};

TEST_F(ListedPersonTest, NeedsCentreScaleAndAJoint) {
  EXPECT_EQ(why_not_listed(person_, choice_), "");
  VolumePerson other = person_;
  other.center = kMissingPoint;
  EXPECT_EQ(why_not_listed(other, choice_), "no centre or no scale");
  other = person_;
  for (const double scale : {-1.0, 0.0}) {  // which a trainer divides by
    other.scale = scale;
    EXPECT_EQ(why_not_listed(other, choice_), "no centre or no scale");
  }
  other = person_;
  other.joints.assign(3, kMissingPoint);
  EXPECT_EQ(why_not_listed(other, choice_), "no joint annotated");
}

TEST_F(ListedPersonTest, IsCountedFromOneInAnEntry) {
  const Json json = Json::parse(mpii_entry("train/a.png", listed_person(person_, choice_)));
  EXPECT_EQ(json["joints"], Json::parse("[[4.0, 5.0], [-1.0, -1.0], [6.0, 7.0]]"));
  EXPECT_EQ(json["joints_vis"], Json({1, 0, 1}));
  EXPECT_EQ(json["center"], Json({11.0, 21.0}));
  EXPECT_EQ(json["scale"], 0.5);
  EXPECT_EQ(json["image"], "train/a.png");
}

/// A variable of a .mat file as doubles in its own order, with its sides in front.
std::vector<double> read_mat(const std::filesystem::path& file, const char* name) {
  const std::unique_ptr<mat_t, decltype(&Mat_Close)> mat(Mat_Open(file.c_str(), MAT_ACC_RDONLY),
                                                         &Mat_Close);
  const std::unique_ptr<matvar_t, decltype(&Mat_VarFree)> value(Mat_VarRead(mat.get(), name),
                                                                &Mat_VarFree);
  std::vector<double> read;
  for (int i = 0; i < value->rank; ++i) read.push_back(static_cast<double>(value->dims[i]));
  const auto* values = static_cast<const double*>(value->data);
  read.insert(read.end(), values, values + value->nbytes / sizeof(double));
  return read;
}

TEST_F(ListedPersonTest, PckhTruthHasMatlabsOrderAndCountsFromOne) {
  const testing::TemporaryFolder folder;
  PckhTruth truth(choice_.names);
  person_.head_box = Rectangle{1, 2, 3, 4};
  EXPECT_TRUE(truth.add(listed_person(person_, choice_)));
  person_.head_box.reset();  // from neck (3, 4) to head (5, 6)
  EXPECT_TRUE(truth.add(listed_person(person_, choice_)));
  person_.joints[2] = kMissingPoint;
  EXPECT_FALSE(truth.add(listed_person(person_, choice_)));
  truth.write(folder / "gt.mat");
  EXPECT_EQ(read_mat(folder / "gt.mat", "jnt_missing"),
            (std::vector<double>{3, 3, 0, 1, 0, 0, 1, 0, 1, 1, 1}));
  EXPECT_EQ(
      read_mat(folder / "gt.mat", "pos_gt_src"),
      (std::vector<double>{3, 2, 3, 4, -1, 6, 5, -1, 7, 4, -1, 6, 5, -1, 7, 4, -1, -1, 5, -1, -1}));
  const std::vector<double> boxes = read_mat(folder / "gt.mat", "headboxes_src");
  ASSERT_EQ(boxes.size(), 3u + 12);
  EXPECT_EQ(std::vector<double>(boxes.begin(), boxes.begin() + 7),
            (std::vector<double>{2, 2, 3, 2, 4, 3, 5}));  // left, right, top, bottom
  const double diagonal = std::hypot(boxes[8] - boxes[7], boxes[10] - boxes[9]);
  EXPECT_NEAR(0.6 * diagonal, std::hypot(2, 2), 1e-12);
  EXPECT_NEAR((boxes[7] + boxes[8]) / 2, 4 + 1, 1e-12);
  EXPECT_EQ(std::vector<double>(boxes.begin() + 11, boxes.end()),
            (std::vector<double>{1, 2, 1, 2}));
}

TEST_F(ListedPersonTest, NoHeadSpansFromAJointToItself) {
  PckhTruth truth(choice_.names);
  person_.joints = {{3, 4}, {8, 9}, {3, 4}};  // neck and head
  EXPECT_FALSE(truth.add(listed_person(person_, choice_))) << "no distance is within a share of 0";
}

TEST_F(ListedPersonTest, PckhTruthIsTheSameEachTimeAndWholeOrNotThere) {
  const testing::TemporaryFolder folder;
  PckhTruth truth(choice_.names);
  for (int i = 0; i < 1000; ++i) truth.add(listed_person(person_, choice_));
  truth.write(folder / "a.mat");
  truth.write(folder / "b.mat");
  EXPECT_EQ(testing::read_file(folder / "a.mat"), testing::read_file(folder / "b.mat"));
  const std::string error =
      testing::error_on_full_disk(4096, [&] { truth.write(folder / "c.mat"); });
  EXPECT_NE(error.find("c.mat"), std::string::npos) << error;
  EXPECT_EQ(testing::names_in(folder.path()), (std::vector<std::string>{"a.mat", "b.mat"}));
}

}  // namespace
}  // namespace eventgan
