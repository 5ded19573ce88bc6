#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/scenes/layouts/hdf5_tables_internal.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using testing::read_file;
using testing::TemporaryFolder;

void write_example(const std::filesystem::path& path) {
  Hdf5Tables tables(path);
  tables.write("group/table", {2, 3}, std::vector<double>{1, 2, 3, 4, 5, 6.5});
  tables.write("group/other", {2}, std::vector<std::int64_t>{-1, 1LL << 40});
  tables.close();
}

TEST(Hdf5Tables, ReadBack) {
  const TemporaryFolder folder;
  write_example(folder / "t.h5");
  const hid_t file = H5Fopen((folder / "t.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  double values[6] = {};
  std::int64_t integers[2] = {};
  const hid_t table = H5Dopen2(file, "group/table", H5P_DEFAULT);
  const hid_t other = H5Dopen2(file, "group/other", H5P_DEFAULT);
  EXPECT_GE(H5Dread(table, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
  EXPECT_GE(H5Dread(other, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, integers), 0);
  H5Dclose(other);
  H5Dclose(table);
  H5Fclose(file);
  EXPECT_THAT(values, ::testing::ElementsAre(1, 2, 3, 4, 5, 6.5));
  EXPECT_THAT(integers, ::testing::ElementsAre(-1, 1LL << 40));
}

TEST(Hdf5Tables, NoTimeOfWritingIsStored) {
  const TemporaryFolder folder;
  write_example(folder / "a.h5");
  const hid_t file = H5Fopen((folder / "a.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  H5O_info_t info;
  ASSERT_GE(H5Oget_info_by_name(file, "group/table", &info, H5P_DEFAULT), 0);
  EXPECT_EQ(info.mtime, 0);
  ASSERT_GE(H5Oget_info_by_name(file, "group", &info, H5P_DEFAULT), 0);
  EXPECT_EQ(info.mtime, 0);
  H5Fclose(file);
}

TEST(Hdf5Tables, FailuresNameThePath) {
  const TemporaryFolder folder;
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  EXPECT_THAT([&] { Hdf5Tables tables(folder / "none/t.h5"); },
              ::testing::ThrowsMessage<std::runtime_error>(
                  ::testing::HasSubstr((folder / "none/t.h5").string())));
  Hdf5Tables tables(folder / "t.h5");
  tables.write("x", {1}, std::vector<double>{1});
  EXPECT_THROW(tables.write("x", {1}, std::vector<double>{1}), std::runtime_error);
}

TEST(Hdf5Tables, AFileThatCannotBeMadeLeavesNothingOpen) {
  const TemporaryFolder folder;
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  // HDF5 numbers property lists as they are made.
  const hid_t before = H5Pcreate(H5P_LINK_CREATE);
  EXPECT_THROW(Hdf5Tables(folder / "none/t.h5"), std::runtime_error);
  const hid_t after = H5Pcreate(H5P_LINK_CREATE);
  ASSERT_GE(after - before, 3);  // it has made some
  for (hid_t id = before + 1; id < after; ++id) EXPECT_LE(H5Iis_valid(id), 0) << id - before;
  H5Pclose(after);
  H5Pclose(before);
}

}  // namespace
}  // namespace eventgan
