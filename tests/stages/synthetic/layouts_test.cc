#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stages/synthetic/layouts/detail/mpii_layout_writer.h"
#include "stages/synthetic/layouts/layout_writers.h"
#include "stages/synthetic/layouts/output_files.h"
#include "stages/synthetic/scenes/figure_scene.h"
#include "stages/synthetic/scenes/image.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using testing::read_file;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;

TEST(OutputFiles, AreNumberedWrittenAndCopied) {
  EXPECT_EQ(numbered(7, 3), "007");
  EXPECT_EQ(numbered(0, 1), "0");
  EXPECT_EQ(numbered(12345, 3), "12345");
  const TemporaryFolder folder;
  make_folder(folder / "a/b");
  write_text(folder / "a/b/one.txt", "text");
  copy_output(folder / "a/b/one.txt", folder / "a/two.txt");
  EXPECT_EQ(testing::read_file(folder / "a/two.txt"), "text");
}

TEST(OutputFiles, APngHoldsThePixels) {
  const TemporaryFolder folder;
  Image image = black_image({4, 5});
  set_pixel(image, 3, 2, {10, 20, 30});
  write_png(image, folder / "p.png");
  const cv::Mat read = cv::imread((folder / "p.png").string());
  ASSERT_EQ(read.size(), cv::Size(5, 4));
  EXPECT_EQ(read.at<cv::Vec3b>(2, 3), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(read.at<cv::Vec3b>(2, 2), cv::Vec3b(0, 0, 0));
}

TEST(OutputFiles, FailuresNameThePath) {
  const TemporaryFolder folder;
  write_text(folder / "file", "");
  const auto names = [&](const char* name) {
    return ThrowsMessage<std::runtime_error>(HasSubstr((folder / name).string()));
  };
  EXPECT_THAT([&] { write_text(folder / "none/x", "text"); }, names("none/x"));
  EXPECT_THAT([&] { make_folder(folder / "file/x"); }, names("file/x"));
  EXPECT_THAT([&] { copy_output(folder / "none", folder / "x"); }, names("none"));
  EXPECT_THAT([&] { write_png(black_image({2, 2}), folder / "none/x.png"); }, names("none/x.png"));
  EXPECT_THAT([&] { write_jpeg(black_image({2, 2}), folder / "none/x.jpg"); }, names("none/x.jpg"));
}

RoadLabel example_label() {
  RoadLabel label;
  label.vehicle.type = "Van";
  label.vehicle.height = 2.1;
  label.vehicle.width = 1.85;
  label.vehicle.length = 4.9;
  label.vehicle.location = {-3.456, 1.65, 20};
  label.vehicle.rotation_y = 1.57;
  label.box = {1.234, 2, 300.5, 188};
  label.truncation = 0.25;
  label.occlusion = 2;
  label.alpha = -1.4;
  return label;
}

TEST(KittiText, ALineInTheDevkitsOrderForEachVehicle) {
  EXPECT_EQ(kitti_labels({example_label()}),
            "Van 0.25 2 -1.40 1.23 2.00 300.50 188.00 2.10 1.85 4.90 -3.46 1.65 20.00 1.57\n");
  RoadLabel far = example_label();
  far.dont_care = true;
  EXPECT_EQ(kitti_labels({far}),
            "DontCare -1 -1 -10 1.23 2.00 300.50 188.00 -1 -1 -1 -1000 -1000 -1000 -10\n");
  EXPECT_EQ(kitti_labels({}), "");
}

TEST(KittiText, CalibrationHoldsTheCameraAsAMatrix) {
  std::istringstream lines(kitti_calibration({360, 361, 305, 88}));
  std::string line;
  for (int i = 0; i < 3; ++i) std::getline(lines, line);
  std::istringstream words(line);
  std::string name;
  words >> name;
  EXPECT_EQ(name, "P2:");
  std::vector<double> matrix;
  for (double value; words >> value;) matrix.push_back(value);
  EXPECT_THAT(matrix, ::testing::ElementsAre(360, 0, 305, 0, 0, 361, 88, 0, 0, 0, 1, 0));
}

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

TEST(MpiiAnnotation, VisibilityComesInItsThreeFormsAndATestImageHasNoJoints) {
  MatValue release = mpii_release({entry_of(true)});
  matvar_t* points =
      field(field(field(field(release.get(), "annolist"), "annorect"), "annopoints"), "point");
  EXPECT_EQ(field(points, "is_visible", 0)->class_type, MAT_C_UINT8);
  EXPECT_EQ(field(points, "is_visible", 1)->class_type, MAT_C_CHAR);
  EXPECT_EQ(field(points, "is_visible", 6)->nbytes, 0u);
  release = mpii_release({entry_of(true), entry_of(false)});
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

MatValue example_value() {
  MatValue inner = mat_struct(2, {"number", "text"});
  set_field(inner, 0, "number", mat_number(2.5));
  set_field(inner, 1, "text", mat_text("word"));
  MatValue outer = mat_struct(1, {"inner", "cells", "row"});
  set_field(outer, 0, "inner", std::move(inner));
  std::vector<MatValue> cells;
  cells.push_back(mat_byte(7));
  cells.push_back(mat_empty());
  set_field(outer, 0, "cells", mat_cells(std::move(cells)));
  set_field(outer, 0, "row", mat_row({1, 2, 3}));
  return outer;
}

TEST(MatValues, ReadBack) {
  const TemporaryFolder folder;
  write_mat_file(folder / "m.mat", "OUTER", example_value());
  mat_t* file = Mat_Open((folder / "m.mat").c_str(), MAT_ACC_RDONLY);
  ASSERT_NE(file, nullptr);
  const MatValue read(Mat_VarRead(file, "OUTER"));
  Mat_Close(file);
  ASSERT_NE(read, nullptr);

  matvar_t* inner = Mat_VarGetStructFieldByName(read.get(), "inner", 0);
  EXPECT_EQ(inner->dims[1], 2u);
  const matvar_t* number = Mat_VarGetStructFieldByName(inner, "number", 0);
  EXPECT_EQ(*static_cast<const double*>(number->data), 2.5);
  const matvar_t* text = Mat_VarGetStructFieldByName(inner, "text", 1);
  EXPECT_EQ(text->class_type, MAT_C_CHAR);
  EXPECT_EQ(std::string(static_cast<const char*>(text->data), text->nbytes), "word");
  const matvar_t* unset = Mat_VarGetStructFieldByName(inner, "number", 1);
  EXPECT_EQ(unset->nbytes, 0u) << "fields not set are empty";

  matvar_t* cells = Mat_VarGetStructFieldByName(read.get(), "cells", 0);
  EXPECT_EQ(cells->dims[0], 2u);
  EXPECT_EQ(*static_cast<const std::uint8_t*>(Mat_VarGetCell(cells, 0)->data), 7);
  const matvar_t* row = Mat_VarGetStructFieldByName(read.get(), "row", 0);
  EXPECT_EQ(row->dims[1], 3u);
  EXPECT_EQ(static_cast<const double*>(row->data)[2], 3);
}

TEST(MatValues, TheFileBearsNoDateAndFailuresNameThePath) {
  const TemporaryFolder folder;
  write_mat_file(folder / "a.mat", "OUTER", example_value());
  write_mat_file(folder / "b.mat", "OUTER", example_value());
  const std::string bytes = read_file(folder / "a.mat");
  EXPECT_EQ(bytes, read_file(folder / "b.mat"));
  EXPECT_EQ(bytes.substr(0, 116).find("Created on"), std::string::npos);
  EXPECT_THROWS(write_mat_file(folder / "none/m.mat", "X", mat_number(1)), std::runtime_error,
                (folder / "none/m.mat").string());
}

std::vector<double> read_table(hid_t file, const std::string& name) {
  const hid_t dataset = H5Dopen2(file, name.c_str(), H5P_DEFAULT);
  const hid_t space = H5Dget_space(dataset);
  std::vector<double> values(H5Sget_simple_extent_npoints(space));
  H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Sclose(space);
  H5Dclose(dataset);
  return values;
}

TEST(Human36mLayout, EveryRowIsTheProjectionOfItsCamerasJoints) {
  const testing::TemporaryFolder folder;
  write_human36m_layout(folder / "h36m", 7);
  const auto action = folder / "h36m/S1/Walking-1";
  const hid_t file = H5Fopen((action / "annot.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  ASSERT_GE(file, 0);
  const auto camera = read_table(file, "camera");
  const auto frame = read_table(file, "frame");
  const auto flat = read_table(file, "pose/2d");
  const auto deep = read_table(file, "pose/3d-univ");
  ASSERT_EQ(camera.size(), 24u);
  ASSERT_EQ(flat.size(), 24u * 32 * 2);
  ASSERT_EQ(deep.size(), 24u * 32 * 3);
  for (std::size_t row = 0; row < camera.size(); ++row) {
    const std::string number = std::to_string(static_cast<int>(camera[row]));
    const auto lens = read_table(file, "intrinsics/" + number);  // f_x, c_x, f_y, c_y
    for (std::size_t joint = 32 * row; joint < 32 * (row + 1); ++joint) {
      const double* at = &deep[3 * joint];
      EXPECT_NEAR(flat[2 * joint], lens[0] * at[0] / at[2] + lens[1], 1e-6);
      EXPECT_NEAR(flat[2 * joint + 1], lens[2] * at[1] / at[2] + lens[3], 1e-6);
    }
    char image[64];
    std::snprintf(image, sizeof image, "imageSequence/%s/img_%06d.jpg", number.c_str(),
                  static_cast<int>(frame[row]));
    EXPECT_TRUE(std::filesystem::exists(action / image)) << image;
  }
  H5Fclose(file);
}

TEST(Human36mLayout, NoTimeOfWritingIsStored) {
  const testing::TemporaryFolder folder;
  write_human36m_layout(folder / "h36m", 7);
  const auto path = folder / "h36m/S1/Walking-1/annot.h5";
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  for (const char* name : {"pose", "pose/2d", "camera", "intrinsics"}) {
    // Old, but the same in every version of HDF5, which H5Oget_info_by_name is not.
    H5G_stat_t info;
    ASSERT_GE(H5Gget_objinfo(file, name, false, &info), 0);
    EXPECT_EQ(info.mtime, 0) << name;
  }
  H5Fclose(file);
}

TEST(Human36mLayout, ATableThatCannotBeMadeIsNamedAndLeavesNothingOpen) {
  const testing::TemporaryFolder folder;
  const auto path = folder / "h36m/S1/Walking-1/annot.h5";
  std::filesystem::create_directories(path);
  // HDF5 numbers property lists as they are made.
  const hid_t before = H5Pcreate(H5P_LINK_CREATE);
  EXPECT_THROWS(write_human36m_layout(folder / "h36m", 7), std::runtime_error,
                ::testing::Eq("cannot write " + path.string()));
  const hid_t after = H5Pcreate(H5P_LINK_CREATE);
  for (hid_t id = before + 1; id < after; ++id) EXPECT_LE(H5Iis_valid(id), 0) << id - before;
  EXPECT_EQ(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL), 0);
  H5Pclose(after);
  H5Pclose(before);
}

}  // namespace
}  // namespace eventgan
