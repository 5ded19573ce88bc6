#include "stages/base/archives/hdf5_arrays.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <stdexcept>

#include "stages/base/hdf5/hdf5.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

class Hdf5ArraysTest : public ::testing::Test {
 protected:
  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "some.h5";
};

TEST_F(Hdf5ArraysTest, ReadsNumbersAndTextInAllGroups) {
  testing::write_hdf5(file_, {{"a/b/double", {{1, 2}, std::vector<double>{0.1, -2}}},
                              {"a/float", {{1}, std::vector<float>{0.1f}}},
                              {"int", {{2}, std::vector<std::int64_t>{-7, 54138969}}},
                              {"name", {{2}, std::vector<std::string>{"gr\xc3\xbc\xc3\x9f", ""}}},
                              {"none", {{0, 3}, std::vector<double>{}}}});
  const Hdf5Arrays file = read_hdf5_arrays(file_);
  EXPECT_TRUE(file.unread.empty());
  ASSERT_EQ(file.arrays.size(), 5u);
  EXPECT_THAT(file.arrays.at("a/b/double").shape, ElementsAre(1, 2));
  EXPECT_THAT(std::get<std::vector<double>>(file.arrays.at("a/b/double").values),
              ElementsAre(0.1, -2));
  EXPECT_THAT(std::get<std::vector<float>>(file.arrays.at("a/float").values), ElementsAre(0.1f));
  EXPECT_EQ(file.arrays.at("int").number(1), 54138969);
  EXPECT_EQ(file.arrays.at("name").text(0), "gr\xc3\xbc\xc3\x9f");
  EXPECT_EQ(file.arrays.at("none").size(), 0u);
}

// One dataset of any type, made with HDF5 itself.
void add_dataset(const std::filesystem::path& path, const char* name, hid_t type, hsize_t count,
                 const void* values, bool chunked = false) {
  const Hdf5Handle file(std::filesystem::exists(path)
                            ? H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)
                            : H5Fcreate(path.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT),
                        H5Fclose);
  const Hdf5Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const Hdf5Handle how(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  const hsize_t chunk = 16;
  if (chunked) H5Pset_chunk(how, 1, &chunk);
  const Hdf5Handle dataset(H5Dcreate2(file, name, type, space, H5P_DEFAULT, how, H5P_DEFAULT),
                           H5Dclose);
  ASSERT_GE(hid_t{dataset}, 0);
  if (values != nullptr) {
    ASSERT_GE(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
  }
}

TEST_F(Hdf5ArraysTest, ReadsFixedTextNarrowIntegersAndEnumerations) {
  const Hdf5Handle text(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(text, 4);
  add_dataset(file_, "text", text, 2, "abcdxy\0\0");
  const std::uint8_t bytes[] = {0, 255};
  add_dataset(file_, "bytes", H5T_NATIVE_UINT8, 2, bytes);
  // What h5py makes of numpy's bool.
  const Hdf5Handle truth(H5Tenum_create(H5T_NATIVE_INT8), H5Tclose);
  const std::int8_t numbers[] = {0, 1};
  H5Tenum_insert(truth, "FALSE", &numbers[0]);
  H5Tenum_insert(truth, "TRUE", &numbers[1]);
  add_dataset(file_, "truth", truth, 2, numbers);

  const Hdf5Arrays file = read_hdf5_arrays(file_);
  EXPECT_EQ(file.arrays.at("text").text(0), "abcd");
  EXPECT_EQ(file.arrays.at("text").text(1), "xy");
  EXPECT_EQ(file.arrays.at("bytes").number(1), 255);
  EXPECT_EQ(file.arrays.at("truth").number(1), 1);
}

TEST_F(Hdf5ArraysTest, TellsWhatItLeavesOut) {
  const Hdf5Handle pair(H5Tcreate(H5T_COMPOUND, 8), H5Tclose);
  H5Tinsert(pair, "x", 0, H5T_NATIVE_INT);
  const std::uint64_t big[] = {~std::uint64_t{0}};
  add_dataset(file_, "pair", pair, 1, big);
  add_dataset(file_, "big", H5T_NATIVE_UINT64, 1, big);
  const Hdf5Handle text(H5Tcopy(H5T_C_S1), H5Tclose);
  add_dataset(file_, "latin", text, 1, "\xfc");
  {
    const Hdf5Handle file(H5Fopen(file_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    H5Lcreate_soft("/nowhere", file, "link", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_external("other.h5", "/x", file, "elsewhere", H5P_DEFAULT, H5P_DEFAULT);
    const Hdf5Handle space(H5Screate(H5S_NULL), H5Sclose);
    const Hdf5Handle none(
        H5Dcreate2(file, "null", H5T_NATIVE_INT, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
        H5Dclose);
  }
  const Hdf5Arrays file = read_hdf5_arrays(file_);
  EXPECT_TRUE(file.arrays.empty());
  EXPECT_EQ(file.unread,
            (std::map<std::string, std::string>{{"big", "integers beyond 63 bits"},
                                                {"latin", "text that is not UTF-8"},
                                                {"link", "a link that leads nowhere"},
                                                {"null", "a dataset without values"},
                                                {"pair", "neither numbers nor text"}}));
}

TEST_F(Hdf5ArraysTest, RefusesSizesThatAreNotStoredAndWhatIsNoHdf5File) {
  // 2^50 doubles of which none was ever written: an 8 PiB allocation, if believed.
  add_dataset(file_, "huge", H5T_NATIVE_DOUBLE, hsize_t{1} << 50, nullptr, /*chunked=*/true);
  EXPECT_THROWS(read_hdf5_arrays(file_), std::runtime_error, "0 stored bytes",
                "some.h5 (dataset huge)");
  EXPECT_THROWS(read_hdf5_arrays(folder_ / "absent.h5"), std::runtime_error, "absent.h5");
  testing::write_hdf5(file_, {{"x", {{100}, std::vector<double>(100)}}});
  const std::string whole = testing::read_file(file_);
  for (const std::string& content : {std::string(), std::string("no HDF5"), whole.substr(0, 500)}) {
    testing::write_file(file_, content);
    EXPECT_THROWS(read_hdf5_arrays(file_), std::runtime_error, "some.h5");
  }
}

TEST_F(Hdf5ArraysTest, ReadsHuman36mAnnotations) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const Hdf5Arrays file =
      read_hdf5_arrays(data / "human36m_fetch" / "S1" / "Directions-1" / "annot.h5");
  EXPECT_THAT(file.arrays.at("pose/2d").shape, ElementsAre(18, 32, 2));
  EXPECT_EQ(file.arrays.at("camera").number(17), 55011271);
  EXPECT_EQ(file.arrays.at("intrinsics/54138969").number(1), 512.5);
}

}  // namespace
}  // namespace eventgan
