#include "pipeline/conversion/shard_sink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "manifests/faults.h"
#include "stages/files/sha256.h"
#include "stages/shards/codec/volume_codec.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::names_in;

constexpr ErrorSpec kLenient{ErrorPolicy::kQuarantine, 100, 1};

/// Two shards of two samples without labels, and a sink whose order a test sets.
class ShardSinkTest : public ::testing::Test {
 protected:
  ShardSinkTest() {
    a_.samples.resize(2);
    b_.samples.resize(2);
    sink_.emplace(setup(), pace_);
  }

  SinkSetup setup() {
    return {folder_.path(),
            std::string(64, 'a'),
            kLenient,
            4,
            0,
            [](const PlannedShard& shard) {
              ShardHeader header;
              header.name = shard.name;
              header.sample_count = static_cast<int>(shard.samples.size());
              header.volume = kShape;
              return header;
            },
            [this] { return order_; },
            [this](const PlannedShard& shard) {
              opened_.push_back(shard.name);
              EXPECT_EQ(names_in(folder_.path()).empty(), false);
            },
            [this](const PlannedShard&) { return done_elsewhere_; }};
  }

  bool accept(const PlannedShard& shard, int slot, bool valid = true) {
    SampleMessage message;
    message.shard = &shard;
    message.slot = slot;
    message.sample.sample_id = shard.name + "/" + std::to_string(slot);
    message.sample.pair.gap_frames = slot + 1;
    if (valid) {
      message.chunk = VolumeCodec(ShardHeader().dtype, ShardHeader().deflate_level)
                          .encode(std::vector<float>(kShape.value_count()))
                          .chunk;
    } else {
      message.fail("expected a frame, got none");
    }
    return sink_->accept(message);
  }

  static constexpr VolumeShape kShape{1, {2, 3}};
  testing::TemporaryFolder folder_;
  PlannedShard a_{"a.h5", 0, kShape.size, {}}, b_{"b.h5", 0, kShape.size, {}};
  ShardPace pace_{1};
  StopOrder order_ = StopOrder::kGoOn;
  std::vector<std::string> opened_;
  bool done_elsewhere_ = false;
  std::optional<ShardSink> sink_;
};

TEST_F(ShardSinkTest, CommitsEachShardWithItsMarker) {
  EXPECT_TRUE(accept(a_, 0));
  EXPECT_TRUE(pace_.work_left());
  EXPECT_THAT(sink_->committed(), IsEmpty());
  EXPECT_TRUE(accept(a_, 1, /*valid=*/false));
  EXPECT_FALSE(pace_.work_left());
  EXPECT_TRUE(accept(b_, 0));
  EXPECT_TRUE(accept(b_, 1));
  EXPECT_THAT(names_in(folder_.path()), ElementsAre("a.h5", "a.json", "b.h5", "b.json"));
  EXPECT_THAT(opened_, ElementsAre("a.h5", "b.h5"));
  ASSERT_EQ(sink_->committed().size(), 2u);
  const ShardMarker& marker = sink_->committed()[0].marker;
  EXPECT_EQ(sink_->committed()[0].shard, &a_);
  EXPECT_EQ(parse_marker(testing::read_file(folder_ / "a.json"), "a"), marker);
  EXPECT_EQ(marker.sha256, sha256_of_file(folder_ / "a.h5"));
  EXPECT_EQ(marker.valid, 1);
  EXPECT_EQ(marker.quarantined.at(0).slot, 1);
  EXPECT_EQ(marker.boxes, (std::vector<std::int32_t>{0, 0}));
  EXPECT_EQ(marker.persons, (std::vector<std::int32_t>{0, 0}));
  EXPECT_EQ(marker.gaps, (std::map<int, std::int64_t>{{1, 1}, {2, 1}}));
  EXPECT_GT(marker.wall_seconds, 0);
}

TEST_F(ShardSinkTest, AbandonedLeavesNothing) {
  accept(a_, 0);
  sink_->abandon();
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());
  EXPECT_FALSE(pace_.work_left());
}

TEST_F(ShardSinkTest, FinishingTheShardTakesNoOther) {
  accept(a_, 0);
  order_ = StopOrder::kFinishShard;
  EXPECT_TRUE(accept(a_, 1));
  EXPECT_FALSE(sink_->closed());
  EXPECT_FALSE(accept(b_, 0));
  EXPECT_TRUE(sink_->closed());
  EXPECT_THAT(names_in(folder_.path()), ElementsAre("a.h5", "a.json"));
}

TEST_F(ShardSinkTest, AnAbortDeletesTheFileUnderWayAtOnce) {
  accept(a_, 0);
  accept(a_, 1);
  accept(b_, 0);
  order_ = StopOrder::kAbort;
  EXPECT_FALSE(accept(b_, 1));
  EXPECT_THAT(names_in(folder_.path()), ElementsAre("a.h5", "a.json"));
}

TEST_F(ShardSinkTest, TheShardThatPassesTheLimitsIsTheLast) {
  SinkSetup strict = setup();
  strict.errors.max_count = 3;
  strict.quarantined_before = 3;
  sink_.emplace(strict, pace_);
  EXPECT_TRUE(accept(a_, 0, false));
  EXPECT_TRUE(accept(a_, 1));
  EXPECT_TRUE(sink_->closed());
  EXPECT_EQ(sink_->committed().size(), 1u);
  EXPECT_FALSE(accept(b_, 0));
}

TEST_F(ShardSinkTest, PolicyFailThrowsAtTheFirst) {
  SinkSetup strict = setup();
  strict.errors.policy = ErrorPolicy::kFail;
  sink_.emplace(strict, pace_);
  EXPECT_TRUE(accept(a_, 0));
  EXPECT_THROW(accept(a_, 1, false), TooManyFaults);
  sink_.reset();
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());
}

TEST_F(ShardSinkTest, AFileLostUnderWayIsAnErrorUnlessAnotherHasMadeTheShard) {
  for (const bool done : {false, true}) {
    done_elsewhere_ = done;
    accept(a_, 0);
    std::filesystem::remove(folder_ / names_in(folder_.path()).at(0));
    if (done) {
      EXPECT_TRUE(accept(a_, 1));
      EXPECT_THAT(sink_->done_by_others(), ElementsAre(&a_));
    } else {
      EXPECT_THROW(accept(a_, 1), UnfinishedShardLost);
      sink_->abandon();
    }
    EXPECT_THAT(sink_->committed(), IsEmpty());
    EXPECT_THAT(names_in(folder_.path()), IsEmpty());
  }
  EXPECT_TRUE(accept(b_, 0));  // and goes on
}

}  // namespace
}  // namespace eventgan
