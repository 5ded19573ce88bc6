#include <gtest/gtest.h>

#include <numeric>

#include "stages/recordings/growing_dataset_internal.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

class GrowingDatasetTest : public ::testing::Test {
 protected:
  /// Writes `values` as [rows, 2], `portion` of them at a time, 3 rows a chunk.
  testing::GoldenArray write_and_read(const std::vector<float>& values, std::size_t portion) {
    {
      const Hdf5Lock lock;
      const Hdf5Handle file(H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                            H5Fclose);
      GrowingDataset<float> dataset(file, "d", {2}, {3, 1}, 3);
      for (std::size_t at = 0; at < values.size(); at += portion) {
        dataset.append(std::span(values).subspan(at, std::min(portion, values.size() - at)));
      }
      dataset.close();
    }
    return testing::read_array(path_, "d");
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "f.h5";
};

TEST_F(GrowingDatasetTest, KeepsRowsInOrder) {
  for (const std::size_t rows : {1u, 3u, 4u, 6u, 10u}) {
    std::vector<float> values(2 * rows);
    std::iota(values.begin(), values.end(), 1.0f);
    for (const std::size_t portion : {2u, 4u, 100u}) {
      const testing::GoldenArray read = write_and_read(values, portion);
      EXPECT_EQ(read.shape, (std::vector<std::size_t>{rows, 2}));
      EXPECT_EQ(read.values, values);
    }
  }
}

TEST_F(GrowingDatasetTest, MayStayEmpty) {
  EXPECT_EQ(write_and_read({}, 1).shape, (std::vector<std::size_t>{0, 2}));
}

}  // namespace
}  // namespace eventgan
