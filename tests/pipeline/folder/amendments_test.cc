#include "pipeline/folder/amendments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "manifests/documents/commit_record.h"
#include "manifests/files/sha256.h"
#include "manifests/files/unfinished_files.h"
#include "pipeline/folder/shard_backup.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

const std::string kPlanHash(64, 'a');
const Amendment kFirst{{{"frames", "f1"}}, {"000001", "000007"}};
const Amendment kSecond{{{"frames", "f2"}, {"annotations", "a2"}}, {"000003"}};

TEST(Amendments, AreReadInTheOrderOfTheirRecording) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(read_amendments(folder.path(), kPlanHash), IsEmpty());
  record_amendment(folder.path(), kPlanHash, kFirst);
  EXPECT_THAT(read_amendments(folder.path(), kPlanHash), ElementsAre(kFirst));
  record_amendment(folder.path(), kPlanHash, kSecond);
  EXPECT_THAT(read_amendments(folder.path(), kPlanHash), ElementsAre(kFirst, kSecond));
}

TEST(Amendments, RecordedAtOnceAreAllThere) {
  const testing::TemporaryFolder folder;
  constexpr int kWriters = 8;
  std::vector<std::thread> writers;
  for (int i = 0; i < kWriters; ++i) {
    writers.emplace_back([&, i] {
      record_amendment(folder.path(), kPlanHash, {{{"frames", "f"}}, {std::to_string(i)}});
    });
  }
  for (std::thread& writer : writers) writer.join();
  std::vector<std::string> samples;
  for (const Amendment& one : read_amendments(folder.path(), kPlanHash)) {
    samples.push_back(one.samples.at(0));
  }
  EXPECT_THAT(samples, ::testing::UnorderedElementsAre("0", "1", "2", "3", "4", "5", "6", "7"));
}

TEST(Amendments, OfAnotherPlanDoNotCountAndMakeRoom) {
  const testing::TemporaryFolder folder;
  const std::string other(64, 'b');
  record_amendment(folder.path(), other, kFirst);
  EXPECT_THAT(read_amendments(folder.path(), kPlanHash), IsEmpty());
  record_amendment(folder.path(), kPlanHash, kSecond);
  EXPECT_THAT(read_amendments(folder.path(), kPlanHash), ElementsAre(kSecond));
  EXPECT_THAT(read_amendments(folder.path(), other), IsEmpty());
}

TEST(Amendments, ThatAreDamagedAreAnErrorNamingTheFile) {
  const testing::TemporaryFolder folder;
  record_amendment(folder.path(), kPlanHash, kFirst);
  const std::string text = testing::read_file(folder / "amendments.json");
  testing::write_file(folder / "amendments.json", text.substr(0, text.size() / 2));
  EXPECT_THROWS(read_amendments(folder.path(), kPlanHash), std::runtime_error, "amendments.json");
  testing::write_file(folder / "amendments.json", "");
  EXPECT_THROWS(read_amendments(folder.path(), kPlanHash), std::runtime_error,
                "amendments.json:1:1: expected JSON");
  EXPECT_THROWS(record_amendment(folder.path(), kPlanHash, kSecond), std::runtime_error,
                "amendments.json:1:1: expected JSON");
  std::filesystem::remove(folder / "amendments.json");
  std::filesystem::create_directory(folder / "amendments.json");
  EXPECT_THROWS(read_amendments(folder.path(), kPlanHash), std::runtime_error, "amendments.json");
}

TEST(Amendments, MayNotChangeWhatTheJobIs) {
  const testing::TemporaryFolder folder;
  EXPECT_THROWS(record_amendment(folder.path(), kPlanHash, {{{"weights", "w"}}, {}}),
                std::invalid_argument, "this field may not change: weights");
  record_amendment(folder.path(), kPlanHash, kFirst);
  std::string text = testing::read_file(folder / "amendments.json");
  text.replace(text.find("frames"), 6, "weights");
  testing::write_file(folder / "amendments.json", text);
  EXPECT_THROWS(read_amendments(folder.path(), kPlanHash), std::runtime_error,
                "expected fields that may change: annotations, frames, labels, got weights");
}

TEST(IsAmendable, HoldsForWhatIsReadFromInputsAndIsAddableForWhatLabelsMean) {
  EXPECT_TRUE(is_amendable("frames"));
  EXPECT_TRUE(is_amendable("annotations"));
  for (const char* field : {"weights", "engine", "cpu", "manifest $.seed", "", "frame"}) {
    EXPECT_FALSE(is_amendable(field)) << field;
  }
  EXPECT_TRUE(is_addable("labels 0 class 2"));
  for (const char* field : {"labels", "annotations", "manifest $.sources[0].labels"}) {
    EXPECT_FALSE(is_addable(field)) << field;
  }
}

TEST(Amended, TakesTheNewestValueOfAField) {
  EXPECT_THAT(amended({{"frames", "f0"}, {"annotations", "a0"}, {"weights", "w"}}, {kFirst}),
              ElementsAre(::testing::Pair("annotations", "a0"), ::testing::Pair("frames", "f1"),
                          ::testing::Pair("weights", "w")));
  EXPECT_THAT(amended({{"frames", "f0"}}, {kFirst, kSecond}),
              ElementsAre(::testing::Pair("annotations", "a2"), ::testing::Pair("frames", "f2")));
  EXPECT_THAT(amended({{"frames", "f0"}}, {}), ElementsAre(::testing::Pair("frames", "f0")));
}

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

  void write_commit_record_of(const std::string& content) const {
    CommitRecord record;
    record.shard = frozen_.plan.shards[0].name;
    record.plan_hash = frozen_.hash;
    record.sha256 = sha256_hex(content);
    record.size_bytes = static_cast<std::int64_t>(content.size());
    record.samples = record.valid = 1;
    record.contents.boxes = record.contents.persons = {0};
    testing::write_file(folder_ / "job-train-00000-of-00001.json", to_json(record));
  }

  /// A backup as a process leaves it that is killed; `pid` is the process.
  fs::path leave_backup(pid_t pid, const std::string& content) const {
    const fs::path path =
        folder_ / to_string(TemporaryName{shard_.filename().string(), host_name(), pid, 3});
    testing::write_file(path, content);
    return path;
  }

  void write_commit_record_of_plan(const std::string& content, const std::string& plan_hash) {
    const std::string own = std::exchange(frozen_.hash, plan_hash);
    write_commit_record_of(content);
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

TEST_F(ShardBackupTest, LeavesAShardThatWasNotReplacedAsItIsAndOfNoneDoesNothing) {
  { const ShardBackup backup(shard_); }
  EXPECT_EQ(content(), "before");
  EXPECT_EQ(files(), 1);
  fs::remove(shard_);
  { const ShardBackup backup(shard_); }
  EXPECT_EQ(files(), 0);
}

TEST_F(ShardBackupTest, AfterAKillBetweenShardAndCommitRecordTheShardIsRestored) {
  write_commit_record_of("before");
  leave_backup(dead_process(), "before");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "before");
  EXPECT_EQ(files(), 2);
}

TEST_F(ShardBackupTest, AfterAKillBeforeOrAfterThatTheBackupGoes) {
  write_commit_record_of("after");  // both were replaced
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

TEST_F(ShardBackupTest, WhatIsNotTheCommitRecordsDoesNotReplaceADamagedShard) {
  write_commit_record_of("before");
  leave_backup(dead_process(), "befoer");  // a temporary of a writer that was killed
  replace("damage");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "damage");
  EXPECT_EQ(files(), 2);
}

TEST_F(ShardBackupTest, ABackupOfALivingProcessIsItsOwn) {
  write_commit_record_of("before");
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
  write_commit_record_of("before");
  leave_backup(dead_process(), "before");
  fs::remove(shard_);
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "before");
}

TEST_F(ShardBackupTest, WhoeverIsAtTheShardIsLeftToIt) {
  write_commit_record_of("before");
  leave_backup(dead_process(), "before");
  const fs::path at_work = leave_backup(::getpid(), "aft");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
  EXPECT_TRUE(fs::exists(at_work));
}

TEST_F(ShardBackupTest, ACommitRecordOfAnotherPlanVouchesForNothing) {
  write_commit_record_of_plan("before", std::string(64, 'b'));
  leave_backup(dead_process(), "before");
  replace("after");
  restore_shards(folder_.path(), frozen_);
  EXPECT_EQ(content(), "after");
}

}  // namespace
}  // namespace eventgan
