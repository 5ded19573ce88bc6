#include "stages/shards/contents_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

const ShardContents kShard{
    {2, 0, 1}, {0, 0, 1}, {{"Car", 2}, {"Van", 1}}, {{1, 2}, {3, 1}}, {"/labels/poses/camera"}};

TEST(ContentsFaults, AreNoneIfAllIsTheSame) {
  EXPECT_THAT(contents_faults(kShard, kShard), IsEmpty());
  EXPECT_THAT(contents_faults({}, {}), IsEmpty());
}

TEST(ContentsFaults, SayWhatTheMarkerHasAndWhatTheShardHas) {
  ShardContents marker = kShard;
  marker.boxes = {1, 1, 1};
  EXPECT_THAT(contents_faults(marker, kShard),
              ElementsAre("expected number of boxes in slot 0: 1, got 2"));
  marker = kShard;
  marker.persons = {0, 0};
  EXPECT_THAT(contents_faults(marker, kShard),
              ElementsAre("expected number of slots with a count of persons 2, got 3"));
  marker = kShard;
  marker.classes["Car"] = 1;
  EXPECT_THAT(contents_faults(marker, kShard),
              ElementsAre("expected boxes by class Car: 1, Van: 1, got Car: 2, Van: 1"));
}

TEST(ContentsFaults, AreAllTold) {
  EXPECT_THAT(contents_faults({}, kShard),
              ElementsAre("expected number of slots with a count of boxes 0, got 3",
                          "expected number of slots with a count of persons 0, got 3",
                          "expected boxes by class none, got Car: 2, Van: 1",
                          "expected samples by gap none, got 1: 2, 3: 1",
                          "expected optional columns none, got /labels/poses/camera"));
}

}  // namespace
}  // namespace eventgan
