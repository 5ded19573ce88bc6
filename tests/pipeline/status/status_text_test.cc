#include "pipeline/folder/status_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

using ::testing::HasSubstr;

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
  status.running = {{"a-00004.h5", file("a-00004.h5", 7, WriterLife::kAlive, 2)},
                    {"a-00005.h5", file("a-00005.h5", 4242, WriterLife::kUnknown, 200)}};
  status.left_over = {file("a-00006.h5", 5, WriterLife::kDead, 9000)};
  status.damaged = {"/data/out/a-00007.h5: expected size in bytes 5, got 3"};
  status.quarantined = {
      {"a-00000.h5", 3, "x", "expected a picture, got none, in x.png"},
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
            "samples  397 of 1000 written, 3 quarantined\n"
            "work     2 processes are at work, 5 pairs/s, about 2m00s left\n"
            "running\n"
            "  a-00004.h5  node7-1  pid 7     alive    last wrote 2s ago\n"
            "  a-00005.h5  node7-1  pid 4242  unknown  last wrote 3m20s ago\n"
            "left over by dead writers (deleted by the next convert)\n"
            "  .a-00006.h5.node7-1.5.0.tmp  dead  last wrote 2h30m ago\n"
            "damaged (made again by the next convert)\n"
            "  /data/out/a-00007.h5: expected size in bytes 5, got 3\n"
            "quarantined (eventgan retry makes them once their inputs are mended)\n"
            "  2  expected 15 columns, got 5 (first: y, a-00001.h5 slot 8)\n"
            "  1  expected a picture, got none (x, a-00000.h5 slot 3)\n");
}

TEST(StatusText, SaysWhatItDoesNotKnow) {
  FolderStatus status = half_done();
  status.pairs_per_second_of_one.reset();
  EXPECT_THAT(status_text(status), HasSubstr("how fast is known after the first shard\n"));
  status.writers = 0;
  EXPECT_THAT(status_text(status), HasSubstr("nobody is at work; eventgan convert goes on"));
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
            "work     nobody is at work, and every shard is done\n");
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
            nlohmann::json::parse(R"({"planned": 1000, "written": 397, "quarantined": 3})"));
  EXPECT_EQ(json["running"][0], nlohmann::json::parse(R"({"shard": "a-00004.h5", "host": "node7-1",
      "pid": 7, "silent_s": 2.0, "writer": "alive"})"));
  EXPECT_EQ(json["left_over"][0],
            nlohmann::json::parse(R"({"file": ".a-00006.h5.node7-1.5.0.tmp", "host": "node7-1",
      "pid": 5, "silent_s": 9000.0, "writer": "dead"})"));
  EXPECT_EQ(json["damaged"].size(), 1u);
  EXPECT_EQ(json["quarantined_by_reason"],
            nlohmann::json::parse(
                R"({"expected 15 columns, got 5": 2, "expected a picture, got none": 1})"));
  EXPECT_EQ(json["quarantined"][2], nlohmann::json::parse(R"({"sample_id": "z",
      "shard": "a-00002.h5", "slot": 0, "reason": "expected 15 columns, got 5, in z.txt"})"));
  EXPECT_EQ(json["pairs_per_second"], 5);
  EXPECT_EQ(json["seconds_left"], 120);
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
