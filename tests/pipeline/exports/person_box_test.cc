#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "pipeline/exports/detail/exporter.h"

namespace eventgan {
namespace {

using ::testing::Optional;

TEST(PersonBox, HoldsTheJointsAndTheHeadUnlessTheLabelHasOne) {
  constexpr ImageSize kVolume{20, 30};
  ShardSample sample;
  sample.source_size = kVolume;
  sample.source_to_volume = {1, 0, 0, 0, 1, 0};
  VolumePerson& person = sample.labels.persons.emplace_back();
  person.joints = {{10, 10}, {14, 16}, kMissingPoint, {28, 18}};
  const JointChoice choice{{0, 1, 2}, {"knee", "ankle", "hip"}};  // and not the last
  const auto box = [&] { return person_box(sample, 0, choice, kVolume); };
  EXPECT_THAT(box(), Optional(Rectangle{10.5, 10.5, 14.5, 16.5}));  // by edges
  person.head_box = Rectangle{8, -2, 13, 9};
  EXPECT_THAT(box(), Optional(Rectangle{8, 0, 14.5, 16.5})) << "cut to the image";
  person.box = Rectangle{1, 2, 29, 19};
  EXPECT_THAT(box(), Optional(Rectangle{1, 2, 29, 19}));
  person.box = Rectangle{31, 2, 40, 19};
  EXPECT_EQ(box(), std::nullopt) << "nothing of it is in the volume";
}

}  // namespace
}  // namespace eventgan
