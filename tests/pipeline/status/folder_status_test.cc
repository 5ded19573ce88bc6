#include "pipeline/folder/folder_status.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

#include "manifests/faults.h"
#include "manifests/marker.h"
#include "pipeline/folder/output_folder.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A folder with a plan of three shards of two samples each, and whatever a test puts beside it.
class FolderStatusTest : public ::testing::Test {
 protected:
  FolderStatusTest() {
    Plan plan;
    plan.name = "job";
    plan.sources.resize(1);
    for (const char* name : {"a.h5", "b.h5", "c.h5"}) {
      PlannedShard shard{name, 0, {2, 2}, {}};
      for (const char* sample : {"0", "1"}) {
        shard.samples.push_back({name + std::string(sample), "", "", {{"p"}, {"n"}, 1, 0, 1}, ""});
      }
      plan.shards.push_back(shard);
    }
    hash_ = freeze_plan(folder_.path(), plan).hash;
  }

  void commit(const std::string& shard, double wall_seconds = 0,
              std::vector<QuarantinedSample> quarantined = {}) {
    testing::write_file(folder_ / shard, "12345");
    ShardMarker marker;
    marker.shard = shard;
    marker.plan_hash = hash_;
    marker.sha256 = std::string(64, 'a');
    marker.size_bytes = 5;
    marker.samples = 2;
    marker.valid = 2 - static_cast<int>(quarantined.size());
    marker.quarantined = std::move(quarantined);
    marker.boxes = marker.persons = {0, 0};
    marker.gaps = {{1, 2}};
    marker.wall_seconds = wall_seconds;
    testing::write_file(folder_ / marker_name(shard), to_json(marker));
  }

  /// Parent and grandparent live as long as this process.
  void write_temporary(const std::string& target, const std::string& host, pid_t pid,
                       unsigned attempt = 0) {
    testing::write_file(folder_ / to_string(TemporaryName{target, host, pid, attempt}), "");
  }

  FolderStatus status() const { return folder_status(folder_.path()); }

  testing::TemporaryFolder folder_;
  std::string hash_;
};

TEST_F(FolderStatusTest, NeedsAPlan) {
  std::filesystem::remove(folder_ / "plan.json");
  EXPECT_THROW(status(), InputError);
  EXPECT_THROW(folder_status(folder_ / "absent"), InputError);
}

TEST_F(FolderStatusTest, AtTheBeginningEverythingIsMissing) {
  const FolderStatus now = status();
  EXPECT_EQ(now.plan_hash, hash_);
  EXPECT_EQ(now.shards_planned, 3);
  EXPECT_EQ(now.shards_missing(), 3);
  EXPECT_EQ(now.samples_planned, 6);
  EXPECT_FALSE(now.complete());
  EXPECT_EQ(now.pairs_per_second(), 0);
  EXPECT_FALSE(now.seconds_left());
}

TEST_F(FolderStatusTest, AtTheEndNothingIsLeft) {
  for (const char* shard : {"a.h5", "b.h5", "c.h5"}) commit(shard, 1);
  const FolderStatus now = status();
  EXPECT_TRUE(now.complete());
  EXPECT_EQ(now.samples_written, 6);
  EXPECT_EQ(now.seconds_left(), 0);
  EXPECT_THAT(now.damaged, IsEmpty());
}

TEST_F(FolderStatusTest, TheRateIsThatOfEveryoneAtWork) {
  commit("a.h5", 4, {{1, "a1", "expected a picture, got none, in x.png"}});
  write_temporary("b.h5", host_name(), ::getppid());
  write_temporary("c.h5", "node7-1", 4242);
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_done, 1);
  EXPECT_EQ(now.shards_running, 2);
  EXPECT_EQ(now.shards_missing(), 0);
  EXPECT_EQ(now.samples_written, 1);
  ASSERT_EQ(now.quarantined.size(), 1u);
  EXPECT_EQ(now.quarantined[0].shard, "a.h5");
  EXPECT_EQ(now.quarantined[0].slot, 1);
  ASSERT_EQ(now.running.size(), 2u);
  EXPECT_EQ(now.running[0].shard, "b.h5");
  EXPECT_EQ(now.running[0].file.writer, WriterLife::kAlive);
  EXPECT_EQ(now.running[1].file.name.host, "node7-1");
  EXPECT_EQ(now.running[1].file.writer, WriterLife::kUnknown);
  EXPECT_EQ(now.pairs_per_second(), 2 * 2 / 4.0);
  EXPECT_EQ(now.seconds_left(), 4 / 1.0);
}

TEST_F(FolderStatusTest, TheRateIsUnknownBeforeTheFirstShard) {
  write_temporary("b.h5", "node7-1", 4242);
  EXPECT_FALSE(status().pairs_per_second());
  EXPECT_FALSE(status().seconds_left());
}

TEST_F(FolderStatusTest, AWorkerIsCountedOnceHoweverManyFilesItHas) {
  write_temporary("a.json", "node7-1", 4242, 1);
  write_temporary("a.h5", "node7-1", 4242, 0);
  write_temporary("b.h5", "node7-1", 4242, 2);
  write_temporary("a.h5", "node8-1", 4242, 0);
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_running, 2);
  EXPECT_EQ(now.running.size(), 3u);
  EXPECT_EQ(now.writers, 2);
}

TEST_F(FolderStatusTest, DeadWritersLeaveRemainders) {
  const pid_t dead = ::fork();
  if (dead == 0) ::_exit(0);
  ::waitpid(dead, nullptr, 0);
  write_temporary("a.h5", host_name(), dead);
  write_temporary("plan.json", host_name(), dead);
  write_temporary("run.json", "node7-1", 4242);  // neither a shard's nor a remainder
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_running, 0);
  EXPECT_EQ(now.shards_missing(), 3);
  EXPECT_THAT(now.running, IsEmpty());
  ASSERT_EQ(now.left_over.size(), 2u);
  EXPECT_EQ(now.left_over[0].name.target, "a.h5");
  EXPECT_EQ(now.left_over[1].name.target, "plan.json");
}

TEST_F(FolderStatusTest, NamesWhatIsDamagedAndCountsItAsMissing) {
  commit("a.h5");
  testing::write_file(folder_ / "a.h5", "123");
  testing::write_file(folder_ / "b.h5", "12345");
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_missing(), 3);
  EXPECT_THAT(now.damaged, ElementsAre(HasSubstr((folder_ / "a.").string()),
                                       HasSubstr((folder_ / "b.").string())));
}

TEST_F(FolderStatusTest, WhatIsMadeAgainIsRunning) {
  testing::write_file(folder_ / "b.h5", "12345");
  write_temporary("b.json", "node7-1", 4242);
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_running, 1);
  EXPECT_THAT(now.damaged, IsEmpty());
}

TEST_F(FolderStatusTest, ACommitUnderWayIsNoDamage) {
  testing::write_file(folder_ / "b.h5", "12345");
  std::jthread committer([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    commit("b.h5");
  });
  const FolderStatus now = status();
  EXPECT_THAT(now.damaged, IsEmpty());
  EXPECT_EQ(now.shards_done, 1);
}

}  // namespace
}  // namespace eventgan
