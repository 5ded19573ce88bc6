#include <gtest/gtest.h>

#include "pipeline/folder/folder_status.h"

namespace eventgan {
namespace {

TEST(WorkerRate, IsUnknownBeforeTheFirstCommit) {
  EXPECT_FALSE(worker_rate({}, 3));
  EXPECT_FALSE(worker_rate({{1, 10, 0}, {2, 0, 5}}, 1));  // markers that do not know their time
}

TEST(WorkerRate, IsSamplesASecond) {
  EXPECT_DOUBLE_EQ(*worker_rate({{1, 10, 5}}, 1), 2);
  EXPECT_DOUBLE_EQ(*worker_rate({{1, 10, 5}, {2, 12, 3}}, 1), 3);  // (2 + 4) / 2
}

TEST(WorkerRate, APauseDoesNotCount) {
  EXPECT_DOUBLE_EQ(*worker_rate({{1, 10, 5}, {2, 10, 40000}, {3, 10, 5}}, 1), 2);
}

TEST(WorkerRate, WhatIsLongPastDoesNotCount) {
  std::vector<CommitRecord> records;
  for (int i = 0; i < 100; ++i) records.push_back({double(i), 10, i < 80 ? 1.0 : 5.0});
  EXPECT_DOUBLE_EQ(*worker_rate(records, 1), 2);    // the last 8
  EXPECT_DOUBLE_EQ(*worker_rate(records, 20), 10);  // the last 60: 20 of 2 and 40 of 10 a second
}

}  // namespace
}  // namespace eventgan
