#include "pipeline/conversion/shard_rewrite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/documents/commit_record.h"
#include "pipeline/conversion/retry.h"
#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_check.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

PlannedSample sample(const std::string& id, const std::string& next, const std::string& fault) {
  return {id, "", id, {{"p"}, {next}, 1, 0, 1}, fault};
}

/// Three shards of two samples; "b" and "e" were planned with a missing frame.
Plan plan() {
  Plan plan;
  plan.name = "job";
  plan.sources.resize(2);
  plan.shards = {
      {"job-train-00000-of-00003.h5", 0, {2, 2}, {sample("a", "n", ""), sample("b", "", "hole")}},
      {"job-train-00001-of-00003.h5", 0, {2, 2}, {sample("c", "n", ""), sample("d", "n", "")}},
      {"job-train-00002-of-00003.h5", 1, {2, 2}, {sample("e", "", "hole"), sample("b", "n", "")}}};
  return plan;
}

CommitRecord record(const PlannedShard& shard, const std::vector<int>& quarantined) {
  CommitRecord record;
  record.shard = shard.name;
  record.plan_hash = record.sha256 = std::string(64, 'a');
  record.size_bytes = 1;
  record.samples = static_cast<int>(shard.samples.size());
  for (const int slot : quarantined) {
    record.quarantined.push_back(
        {slot, shard.samples[static_cast<std::size_t>(slot)].sample_id, "why"});
  }
  record.valid = record.samples - static_cast<int>(quarantined.size());
  record.contents.boxes = record.contents.persons = {0, 0};
  return record;
}

void put(const testing::TemporaryFolder& folder, const CommitRecord& record) {
  testing::write_file(folder / record.shard, "x");
  testing::write_file(folder / commit_record_name(record.shard), to_json(record));
}

TEST(FindQuarantined, LooksAtCommittedShardsAlone) {
  const testing::TemporaryFolder folder;
  const FrozenOutline frozen{outline_of(plan()), std::string(64, 'a')};
  put(folder, record(plan().shards[0], {}));
  put(folder, record(plan().shards[2], {0, 1}));
  QuarantinedSamples found = find_quarantined(folder.path(), frozen);
  EXPECT_THAT(found.shards, ElementsAre(2u));
  EXPECT_EQ(found.count, 2);
  EXPECT_EQ(found.shards_missing, 1);
  EXPECT_THAT(found.damaged, IsEmpty());

  testing::write_file(folder / "job-train-00002-of-00003.h5", "");
  found = find_quarantined(folder.path(), frozen);
  EXPECT_THAT(found.shards, IsEmpty());
  EXPECT_EQ(found.count, 0);
  EXPECT_THAT(found.damaged, testing::texts_with({"job-train-00002-of-00003.h5"}));
}

TEST(PlanRetry, TakesQuarantinedSamplesAsTheyArePlanned) {
  Plan frozen = plan();
  frozen.shards[1].size_unknown = true;
  const auto retried = plan_retry({{&frozen.shards[1], record(frozen.shards[1], {1})},
                                   {&frozen.shards[2], record(frozen.shards[2], {0, 1})}});
  ASSERT_EQ(retried.size(), 2u);
  EXPECT_EQ(retried[0].name, frozen.shards[1].name);
  EXPECT_EQ(retried[0].volume_size, (ImageSize{2, 2}));
  EXPECT_TRUE(retried[0].size_unknown);
  ASSERT_EQ(retried[0].samples.size(), 1u);
  EXPECT_EQ(retried[0].samples[0].sample_id, "d");
  ASSERT_EQ(retried[1].samples.size(), 2u);
  EXPECT_EQ(retried[1].samples[0].sample_id, "e");
  EXPECT_EQ(retried[1].samples[1].sample_id, "b");
  EXPECT_EQ(retried[1].source, 1);
  EXPECT_FALSE(retried[1].size_unknown);
  EXPECT_THAT(plan_retry({}), IsEmpty());
}

// The example's slot 2 is quarantined (see example_shard.h); here slot 0 is, too.
class ShardRewriteTest : public ::testing::Test {
 protected:
  ShardRewriteTest() : whole_(testing::example_shard()), broken_(whole_) {
    broken_.samples[0].valid = false;
    broken_.samples[0].fault = "no such image";
    broken_.samples[0].labels = {};
    broken_.samples[0].statistics = {};
    broken_.volumes[0].clear();
    before_ = write_shard(folder_.path(), broken_);
    before_.wall_seconds = 10;
    before_.stage_seconds = {{"read", 1.0}};
    testing::write_file(commit_record_file(), to_json(before_));
    bytes_before_ = testing::read_file(shard());
  }

  std::filesystem::path shard() const { return folder_ / before_.shard; }
  std::filesystem::path commit_record_file() const {
    return folder_ / commit_record_name(before_.shard);
  }
  CommitRecord record() const {
    return parse_commit_record(testing::read_file(commit_record_file()), "commit record");
  }

  /// What the stages make of a slot.
  SampleMessage message(const testing::ExampleShard& from, std::size_t slot) const {
    SampleMessage message;
    message.sample = from.samples[slot];
    if (message.sample.valid) {
      EncodedVolume encoded =
          VolumeCodec(from.header.dtype, from.header.deflate_level).encode(from.volumes[slot]);
      message.chunk = std::move(encoded.chunk);
      message.sample.scale = encoded.scale;
    }
    message.seconds = {2, 3, 0, 0};
    return message;
  }

  int files() const {
    return static_cast<int>(std::distance(std::filesystem::directory_iterator(folder_.path()), {}));
  }

  testing::TemporaryFolder folder_;
  testing::ExampleShard whole_;
  testing::ExampleShard broken_;
  CommitRecord before_;
  std::string bytes_before_;
};

TEST_F(ShardRewriteTest, AMendedSampleGivesTheShardThatWasMeantFromTheStart) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(whole_, 0));
  rewrite.redo(2, message(whole_, 2));  // fails as before
  EXPECT_EQ(testing::read_file(shard()), bytes_before_) << "not before the commit";
  EXPECT_TRUE(rewrite.commit());

  const testing::TemporaryFolder other;
  const CommitRecord expected = write_shard(other.path(), whole_);
  EXPECT_EQ(testing::read_file(shard()), testing::read_file(other / expected.shard));
  CommitRecord got = record();
  EXPECT_EQ(got.quarantined, expected.quarantined);
  EXPECT_THAT(got.contents.boxes, ElementsAre(2, 0, 0, 1, 0));
  EXPECT_EQ(got.stage_seconds["read"], 1 + 2 + 2);
  EXPECT_EQ(got.stage_seconds["generate"], 3 + 3);
  EXPECT_EQ(got.wall_seconds, 10);
  got.stage_seconds.clear();
  got.wall_seconds = 0;
  EXPECT_EQ(got, expected);
  EXPECT_THAT(check_shard(shard(), record()), IsEmpty());
  EXPECT_EQ(files(), 2) << "no temporary is left";
}

TEST_F(ShardRewriteTest, WhatLabelsOfMendedSamplesLostIsAdded) {
  before_.inputs.losses.boxes = {1, {"a"}};
  ShardRewrite rewrite(folder_.path(), before_);
  SampleMessage mended = message(whole_, 0);
  mended.sample.annotation.left_out = {"b"};
  rewrite.redo(0, mended);
  EXPECT_TRUE(rewrite.commit());
  EXPECT_THAT(rewrite.mended().notes(), ElementsAre("1 box of labels left out: b"));
  EXPECT_THAT(record().inputs.notes(), ElementsAre("2 boxes of labels left out: a; b"));
}

TEST_F(ShardRewriteTest, NothingIsTouchedIfAllFailAsBefore) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(broken_, 0));
  rewrite.redo(2, message(broken_, 2));
  EXPECT_FALSE(rewrite.commit());
  EXPECT_EQ(files(), 2);
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(record(), before_);
}

TEST_F(ShardRewriteTest, AnotherReasonIsRecorded) {
  broken_.samples[2].fault = "expected an image, got text";
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(broken_, 0));
  rewrite.redo(2, message(broken_, 2));
  EXPECT_TRUE(rewrite.commit());
  EXPECT_EQ(testing::read_file(shard()), bytes_before_) << "reasons are in the commit record alone";
  EXPECT_THAT(record().quarantined,
              ElementsAre(QuarantinedSample{0, "000000", "no such image"},
                          QuarantinedSample{2, "000002", "expected an image, got text"}));
  EXPECT_THAT(check_shard(shard(), record()), IsEmpty());
}

TEST_F(ShardRewriteTest, AnAnnotationThatWasMendedIsKeptThoughTheSampleFails) {
  broken_.samples[2].annotation.original = "Car, mended";
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(2, message(broken_, 2));
  EXPECT_TRUE(rewrite.commit());
  EXPECT_EQ(ShardReader(shard()).sample(2).annotation.original, "Car, mended");
  EXPECT_EQ(record().quarantined, before_.quarantined);
}

TEST_F(ShardRewriteTest, OneThatIsGivenUpLeavesTheShardAsItWas) {
  {
    ShardRewrite rewrite(folder_.path(), before_);
    rewrite.redo(0, message(whole_, 0));
    EXPECT_EQ(files(), 3);
  }
  EXPECT_EQ(files(), 2);
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(record(), before_);
}

TEST_F(ShardRewriteTest, WhatAnotherHasPutInItsPlaceMeanwhileStays) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(whole_, 0));
  const CommitRecord others = write_shard(folder_.path(), whole_);
  testing::write_file(commit_record_file(), to_json(others));
  const std::string bytes = testing::read_file(shard());
  EXPECT_THROWS(rewrite.commit(), std::runtime_error, shard().string());
  EXPECT_EQ(testing::read_file(shard()), bytes);
  EXPECT_EQ(record(), others);
}

TEST_F(ShardRewriteTest, OneWhoseCommitRecordIsGoneIsLeftAsItIs) {
  {
    ShardRewrite rewrite(folder_.path(), before_);
    rewrite.redo(0, message(whole_, 0));
    std::filesystem::remove(commit_record_file());
    EXPECT_THROWS(rewrite.commit(), std::runtime_error, "No such file or directory");
  }
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(files(), 1);
}

}  // namespace
}  // namespace eventgan
