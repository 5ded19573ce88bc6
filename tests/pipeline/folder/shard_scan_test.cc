#include "pipeline/folder/shard_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "manifests/documents/commit_record.h"
#include "manifests/files/sha256.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kPlan(64, 'a');
const std::string kContent = "12345";

class ShardStateTest : public ::testing::Test {
 protected:
  ShardStateTest() {
    record_.shard = shard_.name;
    record_.plan_hash = kPlan;
    record_.sha256 = sha256_hex(kContent);
    record_.size_bytes = 5;
    record_.samples = 2;
    record_.valid = 1;
    record_.quarantined = {{1, "b", "why"}};
    record_.contents.boxes = {1, 0};
    record_.contents.persons = {0, 0};
    write_shard(kContent);
    write_commit_record(to_json(record_));
  }

  void write_shard(const std::string& bytes) const { testing::write_file(shard_file_, bytes); }
  void write_commit_record(const std::string& text) const {
    testing::write_file(commit_record_file_, text);
  }

  ShardState state() const { return shard_state(folder_.path(), shard_, kPlan); }
  ShardState hashed() const {
    return shard_state(folder_.path(), shard_, kPlan, ScanDepth::kBytes);
  }

  void expect(ShardCondition condition, const std::string& fault) const {
    for (const ShardState& found : {state(), hashed()}) {
      EXPECT_EQ(found.condition, condition) << to_string(found.condition);
      EXPECT_FALSE(found.done());
      EXPECT_FALSE(found.record);
      EXPECT_THAT(found.faults, testing::texts_with({fault}));
    }
  }

  testing::TemporaryFolder folder_;
  const ShardOutline shard_{"job-train-00000-of-00001.h5", 0, {2, 2}, 2};
  const std::filesystem::path shard_file_ = folder_ / "job-train-00000-of-00001.h5";
  const std::filesystem::path commit_record_file_ = folder_ / "job-train-00000-of-00001.json";
  CommitRecord record_;
};

TEST_F(ShardStateTest, IsDoneIfRecordPlanAndSizeAgree) {
  for (const ShardState& found : {state(), hashed()}) {
    EXPECT_TRUE(found.done());
    EXPECT_EQ(found.record, record_);
    EXPECT_TRUE(found.sound());
    EXPECT_EQ(found.named_plan, kPlan);
    EXPECT_EQ(found.committed, std::filesystem::last_write_time(commit_record_file_));
  }
}

TEST_F(ShardStateTest, IsMissingWithoutShardAndCommitRecordAndThatIsNoFault) {
  std::filesystem::remove(shard_file_);
  std::filesystem::remove(commit_record_file_);
  EXPECT_EQ(state().condition, ShardCondition::kMissing);
  EXPECT_THAT(hashed().faults, IsEmpty());
}

TEST_F(ShardStateTest, AShardWithoutCommitRecordIsNotCommitted) {
  std::filesystem::remove(commit_record_file_);
  expect(ShardCondition::kUncommitted,
         shard_file_.string() +
             ": expected its commit record job-train-00000-of-00001.json beside it, got no file");
}

TEST_F(ShardStateTest, ACommitRecordWithoutShardIsNotDone) {
  std::filesystem::remove(shard_file_);
  expect(ShardCondition::kNoShard, shard_file_.string() + ": expected the shard");
  std::filesystem::create_directory(shard_file_);
  expect(ShardCondition::kNoShard, "got no file");
}

TEST_F(ShardStateTest, ADamagedCommitRecordIsNotTrustedWhereverItEnds) {
  const std::string text = to_json(record_);
  for (std::size_t end = 0; end + 1 < text.size(); end += 7) {  // the last byte is a newline
    write_commit_record(text.substr(0, end));
    ASSERT_EQ(state().condition, ShardCondition::kDamagedRecord) << end;
  }
  write_commit_record("\xff\xfe not JSON");
  expect(ShardCondition::kDamagedRecord, commit_record_file_.string() + ":");
  EXPECT_THAT(state().faults, ElementsAre(Not(HasSubstr("\n"))));
  std::filesystem::remove(commit_record_file_);
  std::filesystem::create_directory(commit_record_file_);
  expect(ShardCondition::kDamagedRecord, commit_record_file_.string());
}

TEST_F(ShardStateTest, ACommitRecordOfAnotherPlanShardOrLengthIsForeign) {
  CommitRecord other = record_;
  other.plan_hash = std::string(64, 'b');
  write_commit_record(to_json(other));
  expect(ShardCondition::kForeignRecord,
         "expected the commit record of plan " + kPlan + ", got one of");
  other = record_;
  other.shard = "job-train-00007-of-00008.h5";
  write_commit_record(to_json(other));
  expect(ShardCondition::kForeignRecord, "got one of job-train-00007-of-00008.h5");
  other = record_;
  other.samples = other.valid = 1;
  other.quarantined.clear();
  other.contents.boxes = other.contents.persons = {0};
  write_commit_record(to_json(other));
  expect(ShardCondition::kForeignRecord,
         "expected the commit record of 2 samples, got one of 1 samples");
}

TEST_F(ShardStateTest, TruncatedAndEmptiedShardsHaveAnotherSize) {
  for (const std::string& bytes : {kContent.substr(0, 4), std::string(), kContent + "6"}) {
    write_shard(bytes);
    expect(ShardCondition::kOtherSize, shard_file_.string() + ": expected size in bytes 5, got " +
                                           std::to_string(bytes.size()));
  }
}

TEST_F(ShardStateTest, AFlippedBitShowsInTheHashAlone) {
  write_shard("12354");
  EXPECT_TRUE(state().done());
  const ShardState found = hashed();
  EXPECT_EQ(found.condition, ShardCondition::kOtherBytes);
  EXPECT_FALSE(found.record);
  EXPECT_THAT(found.faults,
              ElementsAre(AllOf(StartsWith(shard_file_.string() + ": expected SHA-256 "),
                                HasSubstr("got " + sha256_hex("12354")))));
}

/// Of 100 shards every third is done, the one after it has a damaged commit record, the next is not
/// there.
TEST(ShardStates, AreInTheOrderOfThePlan) {
  const testing::TemporaryFolder folder;
  std::vector<ShardOutline> shards;
  for (int i = 0; i < 100; ++i) {
    const std::string name = "job-train-" + std::to_string(10000 + i) + "-of-10100.h5";
    shards.push_back({name, 0, {2, 2}, 1});
    if (i % 3 == 2) continue;
    CommitRecord record;
    record.shard = name;
    record.plan_hash = kPlan;
    record.sha256 = std::string(64, '0');
    record.size_bytes = 5;
    record.samples = record.valid = 1;
    record.contents.boxes = record.contents.persons = {0};
    testing::write_file(folder / name, "shard");
    testing::write_file(folder / commit_record_name(name), i % 3 == 0 ? to_json(record) : "{");
  }
  const std::vector<ShardState> states = scan_shards(folder.path(), shards, kPlan);
  ASSERT_EQ(states.size(), 100u);
  for (std::size_t i = 0; i < states.size(); ++i) {
    constexpr ShardCondition kExpected[] = {ShardCondition::kDone, ShardCondition::kDamagedRecord,
                                            ShardCondition::kMissing};
    EXPECT_EQ(states[i].outline, shards[i]);
    EXPECT_EQ(states[i].condition, kExpected[i % 3]) << i;
    EXPECT_EQ(states[i].record ? states[i].record->shard : "", i % 3 == 0 ? shards[i].name : "");
  }
}

TEST(ShardStates, OfAnEmptyPlanAreNone) {
  const testing::TemporaryFolder folder;
  EXPECT_TRUE(scan_shards(folder.path(), {}, kPlan).empty());
}

TEST_F(ShardStateTest, AgainOnlyThoseThatAreAskedForAreLookedAt) {
  const std::vector<ShardOutline> shards{shard_, {"job-train-00001-of-00002.h5", 0, {2, 2}, 1}};
  std::vector<ShardState> states = scan_shards(folder_.path(), shards, kPlan);
  write_shard("12354");
  scan_again(folder_.path(), kPlan, /*done=*/false, states, ScanDepth::kBytes);
  EXPECT_TRUE(states[0].done());
  scan_again(folder_.path(), kPlan, /*done=*/true, states, ScanDepth::kBytes);
  EXPECT_EQ(states[0].condition, ShardCondition::kOtherBytes);
  EXPECT_EQ(states[1].condition, ShardCondition::kMissing);
  EXPECT_EQ(states[1].outline, shards[1]);
}

TEST_F(ShardStateTest, WhatIsLeftOutByARequestToStopCountsAsMissing) {
  const ScanOptions stopped{.threads = 1, .stop = [] { return true; }};
  for (const ShardState& state :
       scan_shards(folder_.path(), {shard_}, kPlan, ScanDepth::kRecord, stopped)) {
    EXPECT_EQ(state.condition, ShardCondition::kMissing);
    EXPECT_EQ(state.outline, shard_);
  }
}

}  // namespace
}  // namespace eventgan
