#include "pipeline/retry/shard_rewrite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_check.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

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
  EXPECT_THAT(got.boxes, ElementsAre(2, 0, 0, 1, 0));
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
  broken_.samples[2].fault = "expected a picture, got text";
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(broken_, 0));
  rewrite.redo(2, message(broken_, 2));
  EXPECT_TRUE(rewrite.commit());
  EXPECT_EQ(testing::read_file(shard()), bytes_before_) << "reasons stand in the marker alone";
  EXPECT_THAT(marker().quarantined,
              ElementsAre(QuarantinedSample{0, "000000", "no such picture"},
                          QuarantinedSample{2, "000002", "expected a picture, got text"}));
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

TEST_F(ShardRewriteTest, AMarkerThatCannotBeWrittenPutsTheShardBack) {
  ShardRewrite rewrite(folder_.path(), before_);
  rewrite.redo(0, message(whole_, 0));
  std::filesystem::remove(marker_file());
  std::filesystem::create_directory(marker_file());  // no file can be renamed to it
  EXPECT_THROW(rewrite.commit(), std::runtime_error);
  EXPECT_EQ(testing::read_file(shard()), bytes_before_);
  EXPECT_EQ(files(), 2);
}

}  // namespace
}  // namespace eventgan
