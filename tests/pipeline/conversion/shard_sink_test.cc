#include "pipeline/conversion/shard_sink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "pipeline/conversion/earlier_shards.h"
#include "stages/shards/codec/volume_codec.h"
#include "tests/pipeline/conversion/small_conversion.h"
#include "tests/testing/fake_dataset.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::names_in;
using testing::texts_with;

/// A folder of three whole shards that tests damage.
class EarlierShardsTest : public testing::SmallConversion {
 protected:
  EarlierShardsTest() {
    run();
    frozen_ = read_frozen_plan(folder_ / "out");
    for (const PlannedShard& shard : frozen_.plan.shards) all_.push_back(&shard);
  }

  EarlierShards check(int threads = 2) const {
    return check_earlier_shards(folder_ / "out", frozen_, all_, {threads, {}, {}});
  }

  std::filesystem::path shard(int number) const {
    return out(frozen_.plan.shards[static_cast<std::size_t>(number)].name);
  }
  std::filesystem::path record(int number) const {
    return out(commit_record_name(frozen_.plan.shards[static_cast<std::size_t>(number)].name));
  }

  void flip_a_bit(int number) const {
    std::string bytes = testing::read_file(shard(number));
    bytes[bytes.size() / 2] ^= 4;
    testing::write_file(shard(number), bytes);
  }

  FrozenPlan frozen_;
  std::vector<const PlannedShard*> all_;
};

TEST_F(EarlierShardsTest, WholeShardsAreDone) {
  for (const int threads : {1, 4}) {
    const EarlierShards earlier = check(threads);
    ASSERT_EQ(earlier.done.size(), 3u);
    EXPECT_EQ(earlier.done[1].shard, all_[1]);
    EXPECT_EQ(earlier.done[2].record.samples, 3);
    EXPECT_THAT(earlier.left, IsEmpty());
    EXPECT_THAT(earlier.faults, IsEmpty());
  }
}

TEST_F(EarlierShardsTest, AMissingShardIsLeftWithoutAWord) {
  std::filesystem::remove(shard(1));
  std::filesystem::remove(record(1));
  EXPECT_THAT(check().left, ElementsAre(all_[1]));
  EXPECT_THAT(check().faults, IsEmpty());
}

TEST_F(EarlierShardsTest, AnyDamageIsLeftAndNamed) {
  flip_a_bit(0);
  std::filesystem::remove(record(1));
  std::filesystem::resize_file(shard(2), 7);
  const EarlierShards earlier = check();
  EXPECT_THAT(earlier.done, IsEmpty());
  EXPECT_THAT(earlier.left, ElementsAre(all_[0], all_[1], all_[2]));
  EXPECT_THAT(earlier.faults,
              texts_with({shard(0).string(), shard(1).stem().string(), shard(2).string()}));
  // Only its bytes tell.
  EXPECT_THAT(earlier.distrusted, ElementsAre(::testing::Pair(all_[0]->name, "")));
}

TEST_F(EarlierShardsTest, ConvertSaysSoAndMakesThemAgain) {
  const auto whole = shards();
  flip_a_bit(0);
  testing::write_file(record(1), "{");
  testing::write_file(shard(2), "");
  std::vector<std::string> warnings;
  ConversionOptions warned = options();
  warned.warn = [&](const std::string& text) { warnings.push_back(text); };
  const ConversionReport report = run(warned);
  ASSERT_EQ(warnings.size(), 3u);
  EXPECT_THAT(warnings, ::testing::Each(::testing::EndsWith("; making it again")));
  EXPECT_THAT(warnings[0], HasSubstr("SHA-256"));
  EXPECT_EQ(report.damaged.size(), 3u);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.shards_done_before, 0);
  EXPECT_EQ(shards(), whole);
  EXPECT_THAT(check().left, IsEmpty());
}

TEST_F(EarlierShardsTest, ACommitRecordWithCountsThatAreNotTheShardsIsNamedAndMadeAgain) {
  const auto whole = shards();
  CommitRecord wrong = parse_commit_record(testing::read_file(record(0)), "");
  std::swap(wrong.contents.gaps.begin()->second,
            wrong.contents.gaps[6]);  // as many samples, all of another gap
  wrong.contents.gaps.erase(wrong.contents.gaps.begin());
  testing::write_file(record(0), to_json(wrong));
  const EarlierShards earlier = check();
  EXPECT_THAT(earlier.left, ElementsAre(all_[0]));
  EXPECT_THAT(earlier.faults,
              texts_with({{record(0).string(), "expected samples by gap ", "got 6: "}}));
  const ConversionReport report = run();
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.shards_done_before, 2);
  EXPECT_EQ(shards(), whole);
  EXPECT_THAT(check().left, IsEmpty());
}

TEST_F(EarlierShardsTest, OfNoShardsOrAfterARequestToStopAreNone) {
  EarlierShards earlier =
      check_earlier_shards(folder_ / "out", frozen_, all_, {1, [] { return true; }, {}});
  EXPECT_THAT(earlier.done, IsEmpty());
  EXPECT_THAT(earlier.faults, IsEmpty());  // not looked at is not damaged
  earlier = check_earlier_shards(folder_ / "out", frozen_, {}, {4, {}, {}});
  EXPECT_THAT(earlier.done, IsEmpty());
  EXPECT_THAT(earlier.left, IsEmpty());
}

TEST_F(EarlierShardsTest, QuarantinedSamplesOfDoneShardsAreCounted) {
  EXPECT_EQ(count_quarantined(folder_ / "out", frozen_, all_, {2, {}, {}}), 0);
  testing::write_file(image(1), "");  // spoils pairs 0 and 1
  manifest_.errors = {ErrorPolicy::kQuarantine, 100, 1.0};
  run("spoilt");
  const FrozenPlan spoilt = read_frozen_plan(folder_ / "spoilt");
  EXPECT_EQ(count_quarantined(folder_ / "spoilt", spoilt, all_, {2, {}, {}}), 2);
  std::filesystem::remove(out(commit_record_name(all_[0]->name), "spoilt"));
  EXPECT_EQ(count_quarantined(folder_ / "spoilt", spoilt, all_, {2, {}, {}}), 0);
}

constexpr ErrorSpec kLenient{ErrorPolicy::kQuarantine, 100, 1};

/// Two shards of two samples, and a sink in a folder that others share.
class ShardSinkTest : public ::testing::Test {
 protected:
  ShardSinkTest() {
    manifest_.errors = kLenient;
    manifest_.sources.resize(1);
    manifest_.volume.bins = kShape.bins;
    datasets_.push_back(std::make_unique<testing::FakeDataset>("clip", 0));
    frozen_.hash = std::string(64, 'a');
    for (const char* name : {"job-a-00000-of-00001.h5", "job-b-00000-of-00001.h5"}) {
      frozen_.plan.shards.push_back({name, 0, kShape.size, std::vector<PlannedSample>(2)});
    }
  }

  void open_sink(std::int64_t quarantined_before = 0) {
    sink_.emplace(job_, shared_, quarantined_before);
  }

  /// As the run does: opens the sample's shard with its first, commits it with its last.
  bool accept(const PlannedShard& shard, int slot, bool valid = true) {
    SampleMessage message;
    message.shard = &shard;
    message.slot = slot;
    message.sample.sample_id = shard.name + "/" + std::to_string(slot);
    message.sample.pair.gap_frames = slot + 1;
    message.sample.annotation.left_out = {message.sample.sample_id};
    if (valid) {
      message.chunk = VolumeCodec(manifest_.output.dtype, manifest_.output.deflate_level)
                          .encode(std::vector<float>(kShape.value_count()))
                          .chunk;
    } else {
      message.fail("expected a frame, got none");
    }
    if (slot == 0) sink_->open(shard);
    sink_->add(message);
    return slot == 0 || sink_->commit();
  }

  static constexpr VolumeShape kShape{1, {2, 3}};
  testing::TemporaryFolder folder_;
  JobManifest manifest_;
  std::vector<std::unique_ptr<Dataset>> datasets_;
  testing::FakeGenerator generator_;
  const std::string weights_ = "weights";
  FrozenPlan frozen_;
  RunOptions options_;
  const ConversionJob job_{manifest_,      datasets_, generator_, weights_,
                           folder_.path(), frozen_,   options_};
  SharedFolder shared_{folder_.path(), std::string(64, 'a'), {}, std::chrono::seconds(0)};
  std::optional<ShardSink> sink_;
};

TEST_F(ShardSinkTest, RecordsWhatIsLeftOutOfSamplesThatAreNotTriedAgain) {
  open_sink();
  accept(frozen_.plan.shards[0], 0);
  accept(frozen_.plan.shards[0], 1, /*valid=*/false);
  EXPECT_THAT(sink_->committed().at(0).record.inputs.notes(),
              ElementsAre("1 box of labels left out: job-a-00000-of-00001.h5/0"));
}

TEST_F(ShardSinkTest, WhatADroppedShardCountedIsGoneWithIt) {
  open_sink();
  accept(frozen_.plan.shards[0], 0);
  sink_->abandon();
  for (const int slot : {0, 1}) accept(frozen_.plan.shards[0], slot);
  for (const int slot : {0, 1}) accept(frozen_.plan.shards[1], slot);
  for (const CommittedShard& made : sink_->committed()) {
    EXPECT_EQ(made.record.inputs.losses.boxes.count, 2) << made.record.shard;
  }
  EXPECT_EQ(sink_->committed().size(), 2u);
}

TEST_F(ShardSinkTest, CommitsEachShardWithItsCommitRecord) {
  const PlannedShard &a = frozen_.plan.shards[0], &b = frozen_.plan.shards[1];
  open_sink();
  EXPECT_TRUE(accept(a, 0));
  EXPECT_THAT(sink_->committed(), IsEmpty());
  EXPECT_TRUE(accept(a, 1, /*valid=*/false));
  EXPECT_TRUE(accept(b, 0));
  EXPECT_TRUE(accept(b, 1));
  EXPECT_FALSE(sink_->closed());
  EXPECT_THAT(names_in(folder_.path()),
              ElementsAre("job-a-00000-of-00001.h5", "job-a-00000-of-00001.json",
                          "job-b-00000-of-00001.h5", "job-b-00000-of-00001.json"));
  ASSERT_EQ(sink_->committed().size(), 2u);
  const CommitRecord& record = sink_->committed()[0].record;
  EXPECT_EQ(sink_->committed()[0].shard, &a);
  EXPECT_EQ(parse_commit_record(testing::read_file(folder_ / "job-a-00000-of-00001.json"), "a"),
            record);
  EXPECT_EQ(record.sha256, sha256_of_file(folder_ / "job-a-00000-of-00001.h5"));
  EXPECT_EQ(record.valid, 1);
  EXPECT_EQ(record.quarantined.at(0).slot, 1);
  EXPECT_EQ(record.contents.boxes, (std::vector<std::int32_t>{0, 0}));
  EXPECT_EQ(record.contents.persons, (std::vector<std::int32_t>{0, 0}));
  EXPECT_EQ(record.contents.gaps, (std::map<int, std::int64_t>{{1, 1}, {2, 1}}));
  EXPECT_GT(record.wall_seconds, 0);
  EXPECT_GT(record.peak_bytes, 1 << 20);
}

TEST_F(ShardSinkTest, AClaimStandsUntilTheShardIsThereAndTellsOfItsSamples) {
  open_sink();
  const PlannedShard& a = frozen_.plan.shards[0];
  EXPECT_EQ(shared_.look_at(a), ShardActivity::kFree);
  const auto claim = names_in(folder_.path());
  ASSERT_EQ(claim.size(), 1u);
  accept(a, 0);
  EXPECT_EQ(names_in(folder_.path()).size(), 2u);
  EXPECT_EQ(testing::read_file(folder_ / claim[0]), "1");
  accept(a, 1);
  EXPECT_THAT(names_in(folder_.path()),
              ElementsAre("job-a-00000-of-00001.h5", "job-a-00000-of-00001.json"));
}

TEST_F(ShardSinkTest, AbandonedLeavesNothing) {
  open_sink();
  EXPECT_EQ(shared_.look_at(frozen_.plan.shards[0]), ShardActivity::kFree);
  accept(frozen_.plan.shards[0], 0);
  sink_->abandon();
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());
}

TEST_F(ShardSinkTest, TheShardThatPassesTheLimitsIsTheLast) {
  manifest_.errors.max_count = 3;
  open_sink(/*quarantined_before=*/3);
  EXPECT_FALSE(sink_->closed());
  EXPECT_TRUE(accept(frozen_.plan.shards[0], 0, false));
  EXPECT_TRUE(accept(frozen_.plan.shards[0], 1));
  EXPECT_TRUE(sink_->closed());
  EXPECT_EQ(sink_->committed().size(), 1u);
  open_sink(/*quarantined_before=*/4);
  EXPECT_TRUE(sink_->closed());
}

TEST_F(ShardSinkTest, PolicyFailThrowsAtTheFirst) {
  manifest_.errors.policy = ErrorPolicy::kFail;
  open_sink();
  EXPECT_TRUE(accept(frozen_.plan.shards[0], 0));
  EXPECT_THROWS(accept(frozen_.plan.shards[0], 1, false), TooManyFaults,
                "errors.policy is \"fail\": expected a frame, got none");
  sink_.reset();
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());
}

TEST_F(ShardSinkTest, AFileLostUnderWayIsAnErrorUnlessAnotherHasMadeTheShard) {
  const PlannedShard& a = frozen_.plan.shards[0];
  open_sink();
  accept(a, 0);
  std::filesystem::remove(folder_ / names_in(folder_.path()).at(0));
  EXPECT_THROWS(accept(a, 1), UnfinishedShardLost,
                "expected the file that was being written, got nothing");
  sink_->abandon();
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());

  accept(a, 0);
  std::filesystem::remove(folder_ / names_in(folder_.path()).at(0));
  CommitRecord record;  // another worker's, whose shard is of four bytes
  record.shard = a.name;
  record.plan_hash = frozen_.hash;
  record.sha256 = std::string(64, 'b');
  record.size_bytes = 4;
  record.samples = record.valid = 2;
  record.contents.boxes = record.contents.persons = {0, 0};
  testing::write_file(folder_ / "job-a-00000-of-00001.h5", "made");
  testing::write_file(folder_ / "job-a-00000-of-00001.json", to_json(record));
  EXPECT_FALSE(accept(a, 1));
  EXPECT_THAT(sink_->committed(), IsEmpty());
  EXPECT_THAT(names_in(folder_.path()),
              ElementsAre("job-a-00000-of-00001.h5", "job-a-00000-of-00001.json"));
  EXPECT_EQ(testing::read_file(folder_ / "job-a-00000-of-00001.h5"), "made");
  EXPECT_TRUE(accept(frozen_.plan.shards[1], 0));  // and goes on
}

}  // namespace
}  // namespace eventgan
