#include "stages/scenes/layouts/human36m_layout_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

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
    char picture[64];
    std::snprintf(picture, sizeof picture, "imageSequence/%s/img_%06d.jpg", number.c_str(),
                  static_cast<int>(frame[row]));
    EXPECT_TRUE(std::filesystem::exists(action / picture)) << picture;
  }
  H5Fclose(file);
}

TEST(Human36mLayout, NoTimeOfWritingIsStored) {
  const testing::TemporaryFolder folder;
  write_human36m_layout(folder / "h36m", 7);
  const auto path = folder / "h36m/S1/Walking-1/annot.h5";
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  for (const char* name : {"pose", "pose/2d", "camera", "intrinsics"}) {
    H5O_info_t info;
    ASSERT_GE(H5Oget_info_by_name(file, name, &info, H5P_DEFAULT), 0);
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
  EXPECT_THAT([&] { write_human36m_layout(folder / "h36m", 7); },
              ::testing::ThrowsMessage<std::runtime_error>("cannot write " + path.string()));
  const hid_t after = H5Pcreate(H5P_LINK_CREATE);
  for (hid_t id = before + 1; id < after; ++id) EXPECT_LE(H5Iis_valid(id), 0) << id - before;
  EXPECT_EQ(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL), 0);
  H5Pclose(after);
  H5Pclose(before);
}

}  // namespace
}  // namespace eventgan
