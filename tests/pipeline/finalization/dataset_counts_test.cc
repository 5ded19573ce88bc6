#include <gtest/gtest.h>

#include "pipeline/folder/dataset_description.h"

namespace eventgan {
namespace {

TEST(DatasetCounts, AddUp) {
  ShardMarker marker;
  marker.samples = 3;
  marker.valid = 2;
  marker.size_bytes = 5'000'000'000;
  marker.boxes = {2147483647, 0, 2147483647};
  marker.persons = {1, 0, 4};
  marker.classes = {{"Car", 4'000'000'000}};
  marker.gaps = {{1, 3}};
  DatasetCounts counts;
  EXPECT_EQ(counts.quarantined(), 0);
  add(marker, counts);
  marker.classes = {{"Van", 1}};
  marker.gaps = {{1, 1}, {6, 2}};
  add(marker, counts);
  EXPECT_EQ(counts.shards, 2);
  EXPECT_EQ(counts.samples, 6);
  EXPECT_EQ(counts.quarantined(), 2);
  EXPECT_EQ(counts.boxes, 4LL * 2147483647);
  EXPECT_EQ(counts.persons, 10);
  EXPECT_EQ(counts.size_bytes, 10'000'000'000);
  EXPECT_EQ(counts.classes,
            (std::map<std::string, std::int64_t>{{"Car", 4'000'000'000}, {"Van", 1}}));
  EXPECT_EQ(counts.gaps, (std::map<int, std::int64_t>{{1, 4}, {6, 2}}));
}

}  // namespace
}  // namespace eventgan
