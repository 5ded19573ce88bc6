#include "pipeline/folder/shard_backup.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <utility>

#include "manifests/marker.h"
#include "stages/files/sha256.h"
#include "stages/files/unfinished_files.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

class ShardBackupTest : public ::testing::Test {
 protected:
  ShardBackupTest() {
    frozen_.hash = std::string(64, 'a');
    frozen_.plan.shards = {{"job-train-00000-of-00001.h5", 0, {2, 2}, 1}};
    testing::write_file(shard_, "before");
  }

  /// Puts another file in the shard's place, as ShardWriter does.
  void replace(const std::string& content) const {
    testing::write_file(folder_ / "new", content);
    fs::rename(folder_ / "new", shard_);
  }

  void write_marker_of(const std::string& content) const {
    ShardMarker marker;
    marker.shard = frozen_.plan.shards[0].name;
    marker.plan_hash = frozen_.hash;
    marker.sha256 = sha256_hex(content);
    marker.size_bytes = static_cast<std::int64_t>(content.size());
    marker.samples = marker.valid = 1;
    marker.boxes = marker.persons = {0};
    testing::write_file(folder_ / "job-train-00000-of-00001.json", to_json(marker));
  }

  /// A backup as a process leaves it that is killed; `pid` is the process.
  fs::path leave_backup(pid_t pid, const std::string& content) const {
    const fs::path path =
        folder_ / to_string(TemporaryName{shard_.filename().string(), host_name(), pid, 3});
    testing::write_file(path, content);
    return path;
  }

  void write_marker_of_plan(const std::string& content, const std::string& plan_hash) {
    const std::string own = std::exchange(frozen_.hash, plan_hash);
    write_marker_of(content);
    frozen_.hash = own;
  }

  static pid_t dead_process() {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(0);
    ::waitpid(child, nullptr, 0);
    return child;
  }

  std::string content() const { return testing::read_file(shard_); }
  int files() const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_.path()), {}));
  }

  testing::TemporaryFolder folder_;
  const fs::path shard_ = folder_ / "job-train-00000-of-00001.h5";
  FrozenOutline frozen_;
};

TEST_F(ShardBackupTest, PutsTheShardBackUnlessReleased) {
  {
    const ShardBackup backup(shard_);
    EXPECT_EQ(files(), 2);
    replace("after");
    EXPECT_EQ(content(), "after");
  }
  EXPECT_EQ(content(), "before");
  EXPECT_EQ(files(), 1);
  {
    ShardBackup backup(shard_);
    replace("after");
    backup.release();
    EXPECT_EQ(files(), 1);
  }
  EXPECT_EQ(content(), "after");
}

TEST_F(ShardBackupTest, LeavesAShardThatWasNotReplacedAsItIs) {
  { const ShardBackup backup(shard_); }
  EXPECT_EQ(content(), "before");
  EXPECT_EQ(files(), 1);
}

TEST_F(ShardBackupTest, OfNoShardDoesNothing) {
  fs::remove(shard_);
  { const ShardBackup backup(shard_); }
  EXPECT_EQ(files(), 0);
}

TEST_F(ShardBackupTest, AfterAKillBetweenShardAndMarkerTheShardIsRestored) {
  write_marker_of("before");
  leave_backup(dead_process(), "before");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "before");
  EXPECT_EQ(files(), 2);
}

TEST_F(ShardBackupTest, AfterAKillBeforeOrAfterThatTheBackupGoes) {
  write_marker_of("after");  // both were replaced
  leave_backup(dead_process(), "before");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
  EXPECT_EQ(files(), 2);

  leave_backup(dead_process(), "after");  // neither was
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
  EXPECT_EQ(files(), 2);
}

TEST_F(ShardBackupTest, WhatIsNotTheMarkersDoesNotReplaceADamagedShard) {
  write_marker_of("before");
  leave_backup(dead_process(), "befoer");  // a temporary of a writer that was killed
  replace("damage");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "damage");
  EXPECT_EQ(files(), 2);
}

TEST_F(ShardBackupTest, ABackupOfALivingProcessIsItsOwn) {
  write_marker_of("before");
  const fs::path backup = leave_backup(::getpid(), "before");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
  EXPECT_TRUE(fs::exists(backup));
}

TEST_F(ShardBackupTest, OfAnOldShardIsNotTakenForADeadWriters) {
  fs::last_write_time(shard_, fs::file_time_type::clock::now() - std::chrono::hours(48));
  const ShardBackup backup(shard_);
  const auto files = unfinished_files(folder_.path());
  ASSERT_EQ(files.size(), 1u);
  EXPECT_FALSE(is_stale(files[0]));
}

TEST_F(ShardBackupTest, AShardThatIsGoneIsRestoredToo) {
  write_marker_of("before");
  leave_backup(dead_process(), "before");
  fs::remove(shard_);
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "before");
}

TEST_F(ShardBackupTest, WhoeverIsAtTheShardIsLeftToIt) {
  write_marker_of("before");
  leave_backup(dead_process(), "before");
  const fs::path at_work = leave_backup(::getpid(), "aft");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
  EXPECT_TRUE(fs::exists(at_work));
}

TEST_F(ShardBackupTest, AMarkerOfAnotherPlanVouchesForNothing) {
  write_marker_of_plan("before", std::string(64, 'b'));
  leave_backup(dead_process(), "before");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
}

}  // namespace
}  // namespace eventgan
