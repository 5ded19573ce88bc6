#include "stages/shards/view/view_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

ViewShard shard(const std::string& split, const std::string& name, std::vector<std::int32_t> boxes,
                std::vector<std::int32_t> persons) {
  ViewShard result{split, {}};
  result.marker.shard = name;
  result.marker.samples = static_cast<int>(boxes.size());
  result.marker.valid = result.marker.samples;
  result.marker.boxes = std::move(boxes);
  result.marker.persons = std::move(persons);
  return result;
}

TEST(ViewLayout, NoShards) {
  const ViewLayout layout = lay_out_view({});
  EXPECT_THAT(layout.shards, IsEmpty());
  EXPECT_THAT(layout.splits, IsEmpty());
  EXPECT_THAT(layout.box_offsets, ElementsAre(0));
  EXPECT_EQ(layout.sample_count(), 0);
}

TEST(ViewLayout, SplitsAreWholeRangesInTheOrderOfTheirFirstShard) {
  const ViewLayout layout =
      lay_out_view({shard("val", "v0", {0, 2}, {1, 0}), shard("train", "t0", {3}, {0}),
                    shard("val", "v1", {1, 0, 0}, {0, 0, 4})});
  EXPECT_THAT(layout.splits, ElementsAre(SplitRange{"val", {0, 5}}, SplitRange{"train", {5, 1}}));
  ASSERT_EQ(layout.shards.size(), 3u);
  EXPECT_EQ(layout.shards[0].shard.marker.shard, "v0");
  EXPECT_EQ(layout.shards[1].shard.marker.shard, "v1");
  EXPECT_EQ(layout.shards[2].shard.marker.shard, "t0");
  EXPECT_EQ(layout.shards[1].samples, (RowRange{2, 3}));
  EXPECT_EQ(layout.shards[2].samples, (RowRange{5, 1}));
}

TEST(ViewLayout, OffsetsRunThroughAllShards) {
  const ViewLayout layout =
      lay_out_view({shard("a", "0", {0, 2}, {1, 0}), shard("b", "1", {3}, {0}),
                    shard("a", "2", {1, 0}, {0, 4})});
  // Samples in the order of the view: 0.0, 0.1, 2.0, 2.1, 1.0.
  EXPECT_THAT(layout.box_offsets, ElementsAre(0, 0, 2, 3, 3, 6));
  EXPECT_THAT(layout.person_offsets, ElementsAre(0, 1, 1, 1, 5, 5));
  EXPECT_EQ(layout.shards[1].boxes, (RowRange{2, 1}));
  EXPECT_EQ(layout.shards[1].persons, (RowRange{1, 4}));
  EXPECT_EQ(layout.shards[2].boxes, (RowRange{3, 3}));
  EXPECT_EQ(layout.shards[2].persons, (RowRange{5, 0}));
}

TEST(ViewLayout, RowsBeyond32Bits) {
  const std::int32_t most = 2147483647;
  const ViewLayout layout = lay_out_view({shard("a", "0", {most, most, most}, {0, 0, 0})});
  EXPECT_EQ(layout.box_offsets.back(), 3LL * most);
}

TEST(ViewLayout, QuarantinedSamplesAreNotValid) {
  ViewShard second = shard("a", "1", {0, 0, 0}, {0, 0, 0});
  second.marker.quarantined = {{0, "x", ""}, {2, "y", ""}};
  EXPECT_THAT(lay_out_view({shard("a", "0", {0}, {0}), second}).valid, ElementsAre(1, 0, 1, 0));
}

TEST(ViewLayout, MarkersThatContradictThemselvesAreRefused) {
  const auto message_of = [](const ViewShard& bad) {
    return [bad] { lay_out_view({shard("a", "good", {1}, {1}), bad}); };
  };
  EXPECT_THAT(message_of(shard("a", "bad", {1, 1}, {1})),
              ThrowsMessage<std::runtime_error>(HasSubstr(
                  "expected numbers of persons for 2 samples, got 1, in the marker of bad")));
  EXPECT_THAT(message_of(shard("a", "bad", {-1}, {0})),
              ThrowsMessage<std::runtime_error>(HasSubstr("0 or more boxes of a sample, got -1")));
  ViewShard slot = shard("a", "bad", {1}, {0});
  slot.marker.quarantined = {{1, "x", ""}};
  EXPECT_THAT(message_of(slot),
              ThrowsMessage<std::runtime_error>(HasSubstr("expected a slot below 1, got 1")));
  ViewShard huge = shard("a", "bad", {}, {});
  huge.marker.samples = 3;
  EXPECT_THAT(message_of(huge), ThrowsMessage<std::runtime_error>(HasSubstr("3 samples, got 0")));
}

}  // namespace
}  // namespace eventgan
