#include "pipeline/stopping/shard_pace.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

using std::chrono::seconds;

/// Three threads, and a clock that is moved by hand.
class ShardPaceTest : public ::testing::Test {
 protected:
  std::chrono::steady_clock::time_point now_;
  ShardPace pace_{3, [this] { return now_; }};
};

TEST_F(ShardPaceTest, NothingIsOpenBeforeTheFirstShardAndBetweenShards) {
  EXPECT_FALSE(pace_.open_shard());
  pace_.open(1);
  EXPECT_TRUE(pace_.open_shard());
  pace_.take(10);
  EXPECT_TRUE(pace_.open_shard());  // not committed yet
  pace_.begin_commit();
  pace_.close();
  EXPECT_FALSE(pace_.open_shard());
}

TEST_F(ShardPaceTest, TheRateIsThatOfTheRunSoFar) {
  pace_.open(10);
  for (int i = 0; i < 4; ++i) pace_.take(1);
  now_ += seconds(8);
  EXPECT_EQ(pace_.open_shard()->samples_left, 6);
  EXPECT_DOUBLE_EQ(pace_.open_shard()->seconds_per_sample, 2);  // 8 s for 4
  EXPECT_DOUBLE_EQ(pace_.open_shard()->abort_seconds, 6);       // three at work
  now_ += seconds(12);                                          // the next one keeps us waiting
  EXPECT_DOUBLE_EQ(pace_.open_shard()->seconds_per_sample, 5);
}

TEST_F(ShardPaceTest, TheCommitTakesWhatTheLastOneTook) {
  pace_.open(1);
  pace_.take(1);
  pace_.begin_commit();
  now_ += seconds(7);
  pace_.close();
  pace_.open(2);
  EXPECT_DOUBLE_EQ(pace_.open_shard()->commit_seconds, 7);
  pace_.close();  // given up without a commit
  pace_.open(2);
  EXPECT_DOUBLE_EQ(pace_.open_shard()->commit_seconds, 7);
}

TEST_F(ShardPaceTest, TheFirstCommitTakesWhatASlowDiskWould) {
  pace_.open(10);
  EXPECT_DOUBLE_EQ(pace_.open_shard()->commit_seconds, 0);
  pace_.take(30'000'000);
  pace_.take(10'000'000);  // 20 MB a sample, 200 MB a shard
  EXPECT_DOUBLE_EQ(pace_.open_shard()->commit_seconds, 2);
}

}  // namespace
}  // namespace eventgan
