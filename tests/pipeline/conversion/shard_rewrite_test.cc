#include "pipeline/conversion/shard_rewrite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/documents/marker.h"
#include "pipeline/conversion/retry.h"
#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_check.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

PlannedSample sample(const std::string& id, const std::string& next, const std::string& fault) {
  return {id, "", id, {{"p"}, {next}, 1, 0, 1}, fault};
}

/// Three shards of two samples; "b" and "e" were planned with a hole.
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

ShardMarker marker(const PlannedShard& shard, const std::vector<int>& quarantined) {
  ShardMarker marker;
  marker.shard = shard.name;
  marker.plan_hash = marker.sha256 = std::string(64, 'a');
  marker.size_bytes = 1;
  marker.samples = static_cast<int>(shard.samples.size());
  for (const int slot : quarantined) {
    marker.quarantined.push_back(
        {slot, shard.samples[static_cast<std::size_t>(slot)].sample_id, "why"});
  }
  marker.valid = marker.samples - static_cast<int>(quarantined.size());
  marker.contents.boxes = marker.contents.persons = {0, 0};
  return marker;
}

void put(const testing::TemporaryFolder& folder, const ShardMarker& marker) {
  testing::write_file(folder / marker.shard, "x");
  testing::write_file(folder / marker_name(marker.shard), to_json(marker));
}

TEST(FindQuarantined, LooksAtCommittedShardsAlone) {
  const testing::TemporaryFolder folder;
  const FrozenOutline frozen{outline_of(plan()), std::string(64, 'a')};
  put(folder, marker(plan().shards[0], {}));
  put(folder, marker(plan().shards[2], {0, 1}));
  QuarantinedSamples found = find_quarantined(folder.path(), frozen);
  EXPECT_THAT(found.shards, ElementsAre(2u));
  EXPECT_EQ(found.count, 2);
  EXPECT_EQ(found.shards_missing, 1);
  EXPECT_THAT(found.damaged, IsEmpty());

  testing::write_file(folder / "job-train-00002-of-00003.h5", "");
  found = find_quarantined(folder.path(), frozen);
  EXPECT_THAT(found.shards, IsEmpty());
  EXPECT_EQ(found.count, 0);
  EXPECT_THAT(found.damaged, ElementsAre(HasSubstr("job-train-00002-of-00003.h5")));
}

TEST(PlanRetry, TakesQuarantinedSamplesAsTheyArePlanned) {
  Plan frozen = plan();
  frozen.shards[1].size_unknown = true;
  const auto retried = plan_retry({{&frozen.shards[1], marker(frozen.shards[1], {1})},
                                   {&frozen.shards[2], marker(frozen.shards[2], {0, 1})}});
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
    broken_.samples[0].fault = "no such picture";
    broken_.samples[0].labels = {};
    broken_.samples[0].statistics = {};
    broken_.volumes[0].clear();
    before_ = write_shard(folder_.path(), broken_);
    before_.wall_seconds = 10;
    before_.stage_seconds = {{"read", 1.0}};
    testing::write_file(marker_file(), to_json(before_));
    bytes_before_ = testing::read_file(shard());
  }

  std::filesystem::path shard() const { return folder_ / before_.shard; }
  std::filesystem::path marker_file() const { return folder_ / marker_name(before_.shard); }
  ShardMarker marker() const { return parse_marker(testing::read_file(marker_file()), "marker"); }

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
  ShardMarker before_;
  std::string bytes_before_;
};

TEST_F(ShardRewriteTest, AMendedSampleGivesTheShardThatWasMeantFromTheStart) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(whole_, 0));
  rewrite.redo(2, message(whole_, 2));  // fails as before
  EXPECT_EQ(testing::read_file(shard()), bytes_before_) << "not before the commit";
  EXPECT_TRUE(rewrite.commit());

  const testing::TemporaryFolder other;
  const ShardMarker expected = write_shard(other.path(), whole_);
  EXPECT_EQ(testing::read_file(shard()), testing::read_file(other / expected.shard));
  ShardMarker got = marker();
  EXPECT_EQ(got.quarantined, expected.quarantined);
  EXPECT_THAT(got.contents.boxes, ElementsAre(2, 0, 0, 1, 0));
  EXPECT_EQ(got.stage_seconds["read"], 1 + 2 + 2);
  EXPECT_EQ(got.stage_seconds["generate"], 3 + 3);
  EXPECT_EQ(got.wall_seconds, 10);
  got.stage_seconds.clear();
  got.wall_seconds = 0;
  EXPECT_EQ(got, expected);
  EXPECT_THAT(check_shard(shard(), marker()), IsEmpty());
  EXPECT_EQ(files(), 2) << "no temporary is left";
}

TEST_F(ShardRewriteTest, NothingIsTouchedIfAllFailAsBefore) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(broken_, 0));
  rewrite.redo(2, message(broken_, 2));
  EXPECT_FALSE(rewrite.commit());
  EXPECT_EQ(files(), 2);
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(marker(), before_);
}

TEST_F(ShardRewriteTest, AnotherReasonIsRecorded) {
  broken_.samples[2].fault = "expected an image, got text";
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(broken_, 0));
  rewrite.redo(2, message(broken_, 2));
  EXPECT_TRUE(rewrite.commit());
  EXPECT_EQ(testing::read_file(shard()), bytes_before_) << "reasons stand in the marker alone";
  EXPECT_THAT(marker().quarantined,
              ElementsAre(QuarantinedSample{0, "000000", "no such picture"},
                          QuarantinedSample{2, "000002", "expected an image, got text"}));
  EXPECT_THAT(check_shard(shard(), marker()), IsEmpty());
}

TEST_F(ShardRewriteTest, AnAnnotationThatWasMendedIsKeptThoughTheSampleFails) {
  broken_.samples[2].annotation.original = "Car, mended";
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(2, message(broken_, 2));
  EXPECT_TRUE(rewrite.commit());
  EXPECT_EQ(ShardReader(shard()).sample(2).annotation.original, "Car, mended");
  EXPECT_EQ(marker().quarantined, before_.quarantined);
}

TEST_F(ShardRewriteTest, OneThatIsGivenUpLeavesTheShardAsItWas) {
  {
    ShardRewrite rewrite(folder_.path(), before_);
    rewrite.redo(0, message(whole_, 0));
    EXPECT_EQ(files(), 3);
  }
  EXPECT_EQ(files(), 2);
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(marker(), before_);
}

TEST_F(ShardRewriteTest, WhatAnotherHasPutInItsPlaceMeanwhileStays) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(whole_, 0));
  const ShardMarker others = write_shard(folder_.path(), whole_);
  testing::write_file(marker_file(), to_json(others));
  const std::string bytes = testing::read_file(shard());
  EXPECT_THAT([&] { rewrite.commit(); },
              ::testing::ThrowsMessage<std::runtime_error>(::testing::HasSubstr(shard().string())));
  EXPECT_EQ(testing::read_file(shard()), bytes);
  EXPECT_EQ(marker(), others);
}

TEST_F(ShardRewriteTest, OneWhoseMarkerIsGoneIsLeftAsItIs) {
  {
    ShardRewrite rewrite(folder_.path(), before_);
    rewrite.redo(0, message(whole_, 0));
    std::filesystem::remove(marker_file());
    EXPECT_THROW(rewrite.commit(), std::runtime_error);
  }
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(files(), 1);
}

}  // namespace
}  // namespace eventgan
