#include <gtest/gtest.h>

#include <string>

#include "stages/scenes/figure/figure_casting.h"
#include "stages/scenes/layouts/mpii_annotation_internal.h"

namespace eventgan {
namespace {

/// An entry of two people; what a field holds is told from the values in memory.
DemoMpiiEntry entry_of(bool train) {
  const FigureScene scene(1, {450, 450, 160, 120}, {cast_figure(1, "a"), cast_figure(1, "b")});
  return {"000000001", 1, train, scene.labels(7)};
}

matvar_t* field(matvar_t* structure, const char* name, std::size_t index = 0) {
  return Mat_VarGetStructFieldByName(structure, name, index);
}

double number(const matvar_t* value) { return *static_cast<const double*>(value->data); }

TEST(MpiiAnnotation, JointsCountFromOne) {
  const DemoMpiiEntry entry = entry_of(true);
  const MatValue release = mpii_release({entry});
  matvar_t* people = field(field(release.get(), "annolist"), "annorect");
  ASSERT_EQ(people->dims[1], 2u);
  matvar_t* points = field(field(people, "annopoints", 1), "point");
  ASSERT_EQ(points->dims[1], 16u);
  // Id 0 is the right ankle, id 9 the top of the head, id 15 the left wrist.
  const FigureLabel& second = entry.people[1];
  EXPECT_DOUBLE_EQ(number(field(points, "x", 0)), second.joints[kRightAnkle].x + 1);
  EXPECT_DOUBLE_EQ(number(field(points, "y", 9)), second.joints[kHeadTop].y + 1);
  EXPECT_DOUBLE_EQ(number(field(points, "x", 15)), second.joints[kLeftWrist].x + 1);
  EXPECT_DOUBLE_EQ(number(field(people, "x1", 1)), second.head_box.left + 1);
  EXPECT_DOUBLE_EQ(number(field(people, "scale", 1)),
                   (second.outline.bottom - second.outline.top) / 200);
}

TEST(MpiiAnnotation, VisibilityComesInItsThreeForms) {
  const MatValue release = mpii_release({entry_of(true)});
  matvar_t* points =
      field(field(field(field(release.get(), "annolist"), "annorect"), "annopoints"), "point");
  EXPECT_EQ(field(points, "is_visible", 0)->class_type, MAT_C_UINT8);
  EXPECT_EQ(field(points, "is_visible", 1)->class_type, MAT_C_CHAR);
  EXPECT_EQ(field(points, "is_visible", 6)->nbytes, 0u);
}

TEST(MpiiAnnotation, ATestPictureHasNoJoints) {
  const MatValue release = mpii_release({entry_of(true), entry_of(false)});
  matvar_t* list = field(release.get(), "annolist");
  EXPECT_EQ(field(field(list, "annorect", 1), "annopoints"), nullptr);
  EXPECT_NE(field(field(list, "annorect", 1), "objpos"), nullptr);
  const matvar_t* train = field(release.get(), "img_train");
  EXPECT_EQ(static_cast<const double*>(train->data)[0], 1);
  EXPECT_EQ(static_cast<const double*>(train->data)[1], 0);
}

TEST(MpiiAnnotation, KeyFramesNameFolderAndFile) {
  const MatValue frames = mpii_keyframes({entry_of(true)}, 7);
  const matvar_t* name = field(field(frames.get(), "image"), "name");
  EXPECT_EQ(std::string(static_cast<const char*>(name->data), name->nbytes),
            "000000001/00000007.jpg");
}

}  // namespace
}  // namespace eventgan
