#include "stages/exports/volume_file.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "stages/base/archives/hdf5_arrays.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

const VolumeShape kRowShape{1, {2, 3}};

std::vector<float> row_of(float first) {
  std::vector<float> values(kRowShape.value_count());
  std::iota(values.begin(), values.end(), first);
  return values;
}

TEST(VolumeFile, RowsThatAreNotGivenAreZeros) {
  const testing::TemporaryFolder folder;
  VolumeFile file(folder / "d.hdf5", VolumeLayout::kDavis, 3, kRowShape, sizeof(float));
  const std::vector<float> row = row_of(1);
  file.write_row(2, std::as_bytes(std::span(row)));
  EXPECT_THROWS(file.write_row(2, std::as_bytes(std::span(row))), std::logic_error,
                "expected each row once, got row 2 again");
  file.commit();
  const Hdf5Arrays read = read_hdf5_arrays(folder / "d.hdf5");
  const TypedArray& events = read.arrays.at("davis/events");
  EXPECT_EQ(events.shape, (std::vector<std::size_t>{3, 2, 3, 2}));
  for (std::size_t i = 0; i < 24; ++i) EXPECT_EQ(events.number(i), 0) << i;
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(events.number(24 + i), row[i]) << i;
  const TypedArray& valid = read.arrays.at("davis/valid");
  EXPECT_EQ(valid.number(0) + valid.number(1), 0);
  EXPECT_EQ(valid.number(2), 1);
}

TEST(VolumeFile, HoldsHalves) {
  const testing::TemporaryFolder folder;
  VolumeFile file(folder / "d.hdf5", VolumeLayout::kDavis, 1, kRowShape, 2);
  const std::vector<std::uint16_t> row(kRowShape.value_count(), 0x3800);  // 0.5
  file.write_row(0, std::as_bytes(std::span(row)));
  file.commit();
  const Hdf5Arrays read = read_hdf5_arrays(folder / "d.hdf5");
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(read.arrays.at("davis/events").number(i), 0.5);
}

TEST(VolumeFile, OfRvtHasChannelsFirstAndNothingElse) {
  const testing::TemporaryFolder folder;
  VolumeFile file(folder / "d.h5", VolumeLayout::kRvt, 2, kRowShape, sizeof(float));
  const std::vector<float> row = row_of(1);
  file.write_row(1, std::as_bytes(std::span(row)));
  file.commit();
  const Hdf5Arrays read = read_hdf5_arrays(folder / "d.h5");
  ASSERT_EQ(read.arrays.size(), 1u);
  EXPECT_EQ(read.arrays.at("data").shape, (std::vector<std::size_t>{2, 2, 2, 3}));
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(read.arrays.at("data").number(12 + i), row[i]);
}

TEST(VolumeFile, IsTheSameEachTime) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    VolumeFile file(folder / name, VolumeLayout::kDavis, 2, kRowShape, sizeof(float));
    const std::vector<float> row = row_of(0.5f);
    file.write_row(1, std::as_bytes(std::span(row)));
    file.commit();
  }
  EXPECT_EQ(testing::read_file(folder / "a"), testing::read_file(folder / "b"));
}

TEST(VolumeFile, IsWholeOrNotThere) {
  const testing::TemporaryFolder folder;
  const VolumeShape large{9, {64, 64}};
  const std::string error = testing::error_on_full_disk(16384, [&] {
    VolumeFile file(folder / "d.hdf5", VolumeLayout::kDavis, 2, large, sizeof(float));
    std::vector<float> row(large.value_count());
    for (std::size_t i = 0; i < row.size(); ++i) row[i] = static_cast<float>(i * i % 9973);
    file.write_row(0, std::as_bytes(std::span(row)));
    file.commit();
  });
  EXPECT_NE(error.find("d.hdf5"), std::string::npos) << error;
  EXPECT_TRUE(testing::names_in(folder.path()).empty());
}

}  // namespace
}  // namespace eventgan
