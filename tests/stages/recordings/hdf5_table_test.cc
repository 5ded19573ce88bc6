#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "manifests/faults.h"
#include "stages/recordings/hdf5_table_internal.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class Hdf5TableTest : public ::testing::Test {
 protected:
  Hdf5TableTest()
      : file_(H5Fcreate((folder_ / "f.h5").c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT),
              H5Fclose) {}

  /// A chunked, compressed dataset.
  Hdf5Handle create(const char* name, hid_t type, const Dims& dims, const Dims& chunk) {
    const Hdf5Handle how(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(how, static_cast<int>(chunk.size()), chunk.data());
    H5Pset_deflate(how, 1);
    const Hdf5Handle space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr),
                           H5Sclose);
    return {H5Dcreate2(file_, name, type, space, H5P_DEFAULT, how, H5P_DEFAULT), H5Dclose};
  }

  const Hdf5Lock lock_;
  testing::TemporaryFolder folder_;
  Hdf5Handle file_;
};

TEST_F(Hdf5TableTest, ReadsBlocksAndConverts) {
  std::vector<float> values(12);
  std::iota(values.begin(), values.end(), 0.0f);
  H5Dwrite(create("t", H5T_IEEE_F32BE, {3, 4}, {2, 1}), H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL,
           H5P_DEFAULT, values.data());
  const Hdf5Table table(file_, "t", "f.h5");
  EXPECT_THAT(table.dims(), ElementsAre(3, 4));
  EXPECT_TRUE(table.is_float());
  EXPECT_FALSE(table.is_uint8());
  std::vector<double> block(4);
  table.read({1, 2}, {2, 2}, block.data());
  EXPECT_THAT(block, ElementsAre(6, 7, 10, 11));
  EXPECT_THROW(table.read({2, 0}, {2, 2}, block.data()), Hdf5Error);
}

TEST_F(Hdf5TableTest, RefusesAClaimBeyondWhatIsStored) {
  create("huge", H5T_NATIVE_DOUBLE, {hsize_t{1} << 50, 4}, {1024, 4});
  EXPECT_THAT([&] { Hdf5Table(file_, "huge", "f.h5"); },
              ThrowsMessage<InputError>(
                  AllOf(HasSubstr("0 stored bytes"), HasSubstr("f.h5 (dataset huge)"))));
}

TEST_F(Hdf5TableTest, RefusesWhatIsNoDatasetOfNumbers) {
  const Hdf5Handle group(H5Gcreate2(file_, "g", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  EXPECT_THROW(Hdf5Table(file_, "g", "f.h5"), InputError);
  EXPECT_THROW(Hdf5Table(file_, "g/none", "f.h5"), InputError);
  EXPECT_THROW(Hdf5Table(file_, "none/none", "f.h5"), InputError);
  H5Lcreate_soft("/nowhere", file_, "link", H5P_DEFAULT, H5P_DEFAULT);
  EXPECT_THAT([&] { Hdf5Table(file_, "link", "f.h5"); },
              ThrowsMessage<InputError>(HasSubstr("got none, in f.h5 (dataset link)")));
  const Hdf5Handle pair(H5Tcreate(H5T_COMPOUND, 8), H5Tclose);
  H5Tinsert(pair, "x", 0, H5T_NATIVE_INT);
  create("pair", pair, {1}, {1});
  EXPECT_THAT([&] { Hdf5Table(file_, "pair", "f.h5"); },
              ThrowsMessage<InputError>(HasSubstr("expected numbers, got no numbers [1]")));
}

}  // namespace
}  // namespace eventgan
