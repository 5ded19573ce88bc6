#include "pipeline/folder/folder_status.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "manifests/documents/commit_record.h"
#include "manifests/values/faults.h"
#include "pipeline/folder/output_folder.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(FaultKind, IsWhatIsWrongWithoutWhere) {
  EXPECT_EQ(fault_kind("expected an image, got an empty file, in a/b.png"),
            "expected an image, got an empty file");
  EXPECT_EQ(fault_kind("expected 15 columns, got 5, in label_2/000007.txt, in line 3 (KITTI)"),
            "expected 15 columns, got 5");
  EXPECT_EQ(fault_kind("broken\n  because: expected a box, got none, in a.txt"), "broken");
  EXPECT_EQ(fault_kind("out of luck"), "out of luck");
  EXPECT_EQ(fault_kind(""), "");
}

TEST(WorkerRate, IsSamplesASecondWithoutPausesAndWhatIsLongPast) {
  EXPECT_FALSE(worker_rate({}, 3));
  EXPECT_FALSE(
      worker_rate({{1, 10, 0}, {2, 0, 5}}, 1));  // commit records that do not know their time
  EXPECT_DOUBLE_EQ(*worker_rate({{1, 10, 5}}, 1), 2);
  EXPECT_DOUBLE_EQ(*worker_rate({{1, 10, 5}, {2, 12, 3}}, 1), 3);  // (2 + 4) / 2
  EXPECT_DOUBLE_EQ(*worker_rate({{1, 10, 5}, {2, 10, 40000}, {3, 10, 5}}, 1), 2);
  std::vector<CommitTiming> timings;
  for (int i = 0; i < 100; ++i) timings.push_back({double(i), 10, i < 80 ? 1.0 : 5.0});
  EXPECT_DOUBLE_EQ(*worker_rate(timings, 1), 2);    // the last 8
  EXPECT_DOUBLE_EQ(*worker_rate(timings, 20), 10);  // the last 60: 20 of 2 and 40 of 10 a second
}

constexpr char kA[] = "job-train-00000-of-00003.h5";
constexpr char kB[] = "job-train-00001-of-00003.h5";
constexpr char kC[] = "job-train-00002-of-00003.h5";

/// A folder with a plan of three shards of two samples each, and whatever a test puts beside it.
class FolderStatusTest : public ::testing::Test {
 protected:
  FolderStatusTest() {
    Plan plan;
    plan.name = "job";
    plan.sources.resize(1);
    for (const char* name : {kA, kB, kC}) {
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
    CommitRecord record;
    record.shard = shard;
    record.plan_hash = hash_;
    record.sha256 = std::string(64, 'a');
    record.size_bytes = 5;
    record.samples = 2;
    record.valid = 2 - static_cast<int>(quarantined.size());
    record.quarantined = std::move(quarantined);
    record.contents.boxes = record.contents.persons = {0, 0};
    record.contents.gaps = {{1, 2}};
    record.wall_seconds = wall_seconds;
    testing::write_file(folder_ / commit_record_name(shard), to_json(record));
  }

  /// Parent and grandparent live as long as this process.
  void write_temporary(const std::string& target, const std::string& host, pid_t pid,
                       unsigned attempt = 0, const std::string& text = "") {
    testing::write_file(folder_ / to_string(TemporaryName{target, host, pid, attempt}), text);
  }

  FolderStatus status() const { return folder_status(folder_.path()); }

  testing::TemporaryFolder folder_;
  std::string hash_;
};

TEST_F(FolderStatusTest, NeedsAPlan) {
  std::filesystem::remove(folder_ / "plan.json");
  EXPECT_THROWS(status(), InputError,
                "expected a folder that eventgan convert has written, got no");
  EXPECT_THROWS(folder_status(folder_ / "absent"), InputError,
                "expected a folder that eventgan convert has written, got no");
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
  for (const char* shard : {kA, kB, kC}) commit(shard, 1);
  const FolderStatus now = status();
  EXPECT_TRUE(now.complete());
  EXPECT_EQ(now.samples_written, 6);
  EXPECT_EQ(now.seconds_left(), 0);
  EXPECT_THAT(now.damaged, IsEmpty());
}

TEST_F(FolderStatusTest, SamplesOfShardsUnderWayAreThoseThatTheirWritersTell) {
  commit(kA, 4);
  write_temporary(kA, host_name(), ::getppid(), 0, "2");  // just committed: they count once
  write_temporary(kB, host_name(), ::getppid(), 0, "1");
  write_temporary(kB, host_name(), ::getppid(), 1, "\x89HDF, the shard itself");
  FolderStatus now = status();
  EXPECT_EQ(now.samples_written, 2);
  EXPECT_EQ(now.samples_under_way, 1);
  EXPECT_EQ(now.seconds_left(), 3 / (2 / 4.0));
  write_temporary(kB, "node7-1", 4242, 0, "2");  // two at one shard: the farther one counts
  write_temporary(kC, "node7-1", 4242, 0, "");
  now = status();
  EXPECT_EQ(now.samples_under_way, 2);
  for (const char* nonsense : {"-1", "99", "1 ", "12345678901"}) {
    write_temporary(kC, "node7-1", 4242, 0, nonsense);
    EXPECT_LE(status().samples_under_way, 2 + 2) << nonsense;
    EXPECT_GE(status().samples_under_way, 2) << nonsense;
  }
}

TEST_F(FolderStatusTest, TheRateIsThatOfEveryoneAtWork) {
  commit(kA, 4, {{1, "a1", "expected an image, got none, in x.png"}});
  write_temporary(kB, host_name(), ::getppid());
  write_temporary(kC, "node7-1", 4242);
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_done, 1);
  EXPECT_EQ(now.shards_running, 2);
  EXPECT_EQ(now.shards_missing(), 0);
  EXPECT_EQ(now.samples_written, 1);
  ASSERT_EQ(now.quarantined.size(), 1u);
  EXPECT_EQ(now.quarantined[0].shard, kA);
  EXPECT_EQ(now.quarantined[0].slot, 1);
  ASSERT_EQ(now.running.size(), 2u);
  EXPECT_EQ(now.running[0].shard, kB);
  EXPECT_EQ(now.running[0].file.writer, WriterLife::kAlive);
  EXPECT_EQ(now.running[1].file.name.host, "node7-1");
  EXPECT_EQ(now.running[1].file.writer, WriterLife::kUnknown);
  EXPECT_EQ(now.pairs_per_second(), 2 * 2 / 4.0);
  EXPECT_EQ(now.seconds_left(), 4 / 1.0);
}

TEST_F(FolderStatusTest, TheRateIsUnknownBeforeTheFirstShard) {
  write_temporary(kB, "node7-1", 4242);
  EXPECT_FALSE(status().pairs_per_second());
  EXPECT_FALSE(status().seconds_left());
}

TEST_F(FolderStatusTest, AWorkerIsCountedOnceHoweverManyFilesItHas) {
  write_temporary("a.json", "node7-1", 4242, 1);
  write_temporary(kA, "node7-1", 4242, 0);
  write_temporary(kB, "node7-1", 4242, 2);
  write_temporary(kA, "node8-1", 4242, 0);
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_running, 2);
  EXPECT_EQ(now.running.size(), 3u);
  EXPECT_EQ(now.writers, 2);
}

TEST_F(FolderStatusTest, DeadWritersLeaveRemainders) {
  const pid_t dead = ::fork();
  if (dead == 0) ::_exit(0);
  ::waitpid(dead, nullptr, 0);
  write_temporary(kA, host_name(), dead);
  write_temporary("plan.json", host_name(), dead);
  write_temporary("run.json", "node7-1", 4242);  // neither a shard's nor a remainder
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_running, 0);
  EXPECT_EQ(now.shards_missing(), 3);
  EXPECT_THAT(now.running, IsEmpty());
  ASSERT_EQ(now.left_over.size(), 2u);
  EXPECT_EQ(now.left_over[0].name.target, kA);
  EXPECT_EQ(now.left_over[1].name.target, "plan.json");
}

TEST_F(FolderStatusTest, NamesWhatIsDamagedAndCountsItAsMissing) {
  commit(kA);
  testing::write_file(folder_ / kA, "123");
  testing::write_file(folder_ / kB, "12345");
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_missing(), 3);
  EXPECT_THAT(now.damaged, testing::texts_with({(folder_ / kA).string(), (folder_ / kB).string()}));
}

TEST_F(FolderStatusTest, WhatIsMadeAgainIsRunning) {
  testing::write_file(folder_ / kB, "12345");
  write_temporary(commit_record_name(kB), "node7-1", 4242);
  const FolderStatus now = status();
  EXPECT_EQ(now.shards_running, 1);
  EXPECT_THAT(now.damaged, IsEmpty());
}

TEST_F(FolderStatusTest, ACommitUnderWayIsNoDamage) {
  testing::write_file(folder_ / kB, "12345");
  std::jthread committer([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    commit(kB);
  });
  const FolderStatus now = status();
  EXPECT_THAT(now.damaged, IsEmpty());
  EXPECT_EQ(now.shards_done, 1);
}

UnfinishedFile file(const std::string& target, pid_t pid, WriterLife writer, double silent_s) {
  const TemporaryName name{target, "node7-1", pid, 0};
  return {"/data/out/" + to_string(name), name, writer, silent_s};
}

/// 4 of 10 shards of 100 samples done, two workers at 2.5 pairs/s each.
FolderStatus half_done() {
  FolderStatus status;
  status.folder = "/data/out";
  status.plan_hash = std::string(64, 'c');
  status.shards_planned = 10;
  status.shards_done = 4;
  status.shards_running = 2;
  status.samples_planned = 1000;
  status.samples_written = 397;
  status.samples_under_way = 100;
  status.running = {{"a-00004.h5", file("a-00004.h5", 7, WriterLife::kAlive, 2)},
                    {"a-00005.h5", file("a-00005.h5", 4242, WriterLife::kUnknown, 200)}};
  status.left_over = {file("a-00006.h5", 5, WriterLife::kDead, 9000)};
  status.damaged = {"/data/out/a-00007.h5: expected size in bytes 5, got 3"};
  status.quarantined = {
      {"a-00000.h5", 3, "x", "expected an image, got none, in x.png"},
      {"a-00001.h5", 8, "y", "expected 15 columns, got 5, in y.txt"},
      {"a-00002.h5", 0, "z", "expected 15 columns, got 5, in z.txt"},
  };
  status.writers = 2;
  status.pairs_per_second_of_one = 2.5;
  return status;
}

TEST(StatusText, HasTheNotesOnTheInputs) {
  FolderStatus status = half_done();
  status.notes = {"clip.mp4: 60 of 100 frames"};
  EXPECT_THAT(status_text(status),
              HasSubstr("1 note on the inputs:\n  note: clip.mp4: 60 of 100 frames\n"));
  EXPECT_EQ(nlohmann::json::parse(status_json(status))["notes"][0], status.notes[0]);
}

TEST(StatusText, TellsWhereARunStands) {
  EXPECT_EQ(status_text(half_done()),
            "folder   /data/out\n"
            "plan     cccccccccccccccc\n"
            "shards   4 of 10 done, 2 running, 4 missing (1 of them damaged)\n"
            "samples  397 of 1000 written, 100 more in unfinished shards, 3 quarantined\n"
            "work     2 processes are running, 5 pairs/s, about 1m40s left\n"
            "running\n"
            "  a-00004.h5  node7-1  pid 7     alive    last wrote 2s ago\n"
            "  a-00005.h5  node7-1  pid 4242  unknown  last wrote 3m20s ago\n"
            "left over by dead writers (deleted by the next convert)\n"
            "  .a-00006.h5.node7-1.5.0.tmp  dead  last wrote 2h30m ago\n"
            "damaged (made again by the next convert)\n"
            "  /data/out/a-00007.h5: expected size in bytes 5, got 3\n"
            "quarantined (eventgan retry makes them once their inputs are fixed)\n"
            "  2  expected 15 columns, got 5 (first: y, a-00001.h5 slot 8)\n"
            "  1  expected an image, got none (x, a-00000.h5 slot 3)\n");
}

TEST(StatusText, TellsOfAFileThatIsDatedAheadAndWhatItDoesNotKnow) {
  FolderStatus status = half_done();
  status.left_over = {file("a-00006.h5", 5, WriterLife::kUnknown, -9000)};
  EXPECT_THAT(status_text(status),
              HasSubstr("  .a-00006.h5.node7-1.5.0.tmp  unknown  dated 2h30m ahead\n"));
  status = half_done();
  status.pairs_per_second_of_one.reset();
  EXPECT_THAT(status_text(status), HasSubstr("speed known after the first shard\n"));
  status.writers = 0;
  EXPECT_THAT(status_text(status), HasSubstr("no process is running; eventgan convert resumes"));
}

TEST(StatusText, ACompleteFolderIsFiveLines) {
  FolderStatus status;
  status.folder = "out";
  status.plan_hash = std::string(64, 'c');
  status.shards_planned = status.shards_done = 1;
  status.samples_planned = status.samples_written = 9;
  EXPECT_EQ(status_text(status),
            "folder   out\n"
            "plan     cccccccccccccccc\n"
            "shards   1 of 1 done, 0 running, 0 missing\n"
            "samples  9 of 9 written, 0 quarantined\n"
            "work     no process is running, and every shard is done\n");
}

TEST(StatusText, LongListsAreCut) {
  FolderStatus status = half_done();
  status.damaged.assign(4000, "a.h5: expected size in bytes 5, got 3");
  EXPECT_THAT(status_text(status), HasSubstr("  ... and 3980 more (--json lists them)\n"));
}

TEST(StatusJson, HasEverything) {
  const auto json = nlohmann::json::parse(status_json(half_done()));
  EXPECT_EQ(json["folder"], "/data/out");
  EXPECT_EQ(json["plan_hash"], std::string(64, 'c'));
  EXPECT_EQ(json["complete"], false);
  EXPECT_EQ(json["shards"],
            nlohmann::json::parse(R"({"planned": 10, "done": 4, "running": 2, "missing": 4})"));
  EXPECT_EQ(json["samples"],
            nlohmann::json::parse(
                R"({"planned": 1000, "written": 397, "under_way": 100, "quarantined": 3})"));
  EXPECT_EQ(json["running"][0], nlohmann::json::parse(R"({"shard": "a-00004.h5", "host": "node7-1",
      "pid": 7, "silent_s": 2.0, "writer": "alive"})"));
  EXPECT_EQ(json["left_over"][0],
            nlohmann::json::parse(R"({"file": ".a-00006.h5.node7-1.5.0.tmp", "host": "node7-1",
      "pid": 5, "silent_s": 9000.0, "writer": "dead"})"));
  EXPECT_EQ(json["damaged"].size(), 1u);
  EXPECT_EQ(json["quarantined_by_reason"],
            nlohmann::json::parse(
                R"({"expected 15 columns, got 5": 2, "expected an image, got none": 1})"));
  EXPECT_EQ(json["quarantined"][2], nlohmann::json::parse(R"({"sample_id": "z",
      "shard": "a-00002.h5", "slot": 0, "reason": "expected 15 columns, got 5, in z.txt"})"));
  EXPECT_EQ(json["pairs_per_second"], 5);
  EXPECT_EQ(json["seconds_left"], 100);
}

TEST(StatusJson, IsNullWhereUnknown) {
  FolderStatus status = half_done();
  status.pairs_per_second_of_one.reset();
  const auto json = nlohmann::json::parse(status_json(status));
  EXPECT_TRUE(json["pairs_per_second"].is_null());
  EXPECT_TRUE(json["seconds_left"].is_null());
}

}  // namespace
}  // namespace eventgan
