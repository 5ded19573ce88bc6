#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "pipeline/folder/dataset_description.h"
#include "tests/pipeline/finalization/converted_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using testing::ConvertedFolder;
using ::testing::ElementsAre;
using testing::ExampleShard;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::parts_of;
using ::testing::ThrowsMessage;

TEST(DatasetParts, AreThePlansShardsAndAHeaderOfEachSource) {
  const ConvertedFolder folder;
  const DatasetParts parts = parts_of(folder);
  EXPECT_THAT(parts.missing, IsEmpty());
  ASSERT_EQ(parts.done.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    const ShardState& shard = parts.done[static_cast<std::size_t>(i)];
    EXPECT_EQ(shard.outline.name, folder.shard(i).filename());
    EXPECT_EQ(shard.marker, folder.marker(i));
  }
  EXPECT_EQ(parts.headers.size(), 3u);
  EXPECT_EQ(parts.headers.at(1).name, "demo-val-00000-of-00001.h5");
  EXPECT_EQ(parts.source_of(parts.done[1].outline).split, "val");
  EXPECT_THAT(parts.amendments, IsEmpty());
}

TEST(DatasetParts, WhatIsNotDoneIsNamedWithTheReason) {
  const ConvertedFolder folder(3);
  std::filesystem::remove(folder.marker_file(0));
  testing::write_file(folder.shard(1), "short");
  const DatasetParts parts = parts_of(folder);
  EXPECT_EQ(parts.done.size(), 1u);
  ASSERT_EQ(parts.missing.size(), 3u);
  EXPECT_EQ(parts.missing[0].outline.name, "demo-train-00000-of-00003.h5");
  EXPECT_THAT(parts.missing[0].faults, ElementsAre(HasSubstr("not committed")));
  EXPECT_THAT(parts.missing[1].faults, ElementsAre(HasSubstr("expected size in bytes")));
  EXPECT_EQ(parts.missing[2].condition, ShardCondition::kMissing);
  EXPECT_THAT(parts.missing[2].faults, IsEmpty());
}

TEST(DatasetParts, AShardThatIsNotWhatThePlanSaysIsRefused) {
  const auto expect_refusal = [](void (*change)(ExampleShard&), const char* what) {
    ConvertedFolder folder;
    folder.add(1, change);
    EXPECT_THAT([&] { parts_of(folder); },
                ThrowsMessage<std::runtime_error>(
                    AllOf(HasSubstr(what), HasSubstr("demo-val-00000-of-00001.h5"))));
  };
  expect_refusal([](ExampleShard& shard) { shard.header.plan_hash[0] = 'f'; }, "plan hash");
  expect_refusal(
      [](ExampleShard& shard) {
        shard.header.volume.size = {8, 6};  // the same number of values
      },
      "size of volumes");
}

TEST(DatasetParts, AShardWithOtherBytesIsMissingAndIsNotOpened) {
  const ConvertedFolder folder;
  const auto size = std::filesystem::file_size(folder.shard(2));
  testing::write_file(folder.shard(2), std::string(size, 'x'));
  const DatasetParts parts = parts_of(folder);
  EXPECT_EQ(parts.done.size(), 3u);
  ASSERT_EQ(parts.missing.size(), 1u);
  EXPECT_THAT(parts.missing[0].faults, ElementsAre(AllOf(HasSubstr(folder.shard(2).string()),
                                                         HasSubstr("expected SHA-256"))));
  EXPECT_EQ(parts.headers.at(2).name, "demo-train-00002-of-00003.h5");  // its source's next
}

TEST(DatasetParts, AMarkerWithOtherCountsThanItsShardIsNamed) {
  const ConvertedFolder folder;
  ShardMarker marker = folder.marker(0);
  ++marker.persons[0];
  testing::write_file(folder.marker_file(0), to_json(marker));
  const DatasetParts parts = parts_of(folder);
  ASSERT_EQ(parts.missing.size(), 1u);
  EXPECT_THAT(parts.missing[0].faults,
              ElementsAre(AllOf(HasSubstr(folder.marker_file(0).string()),
                                HasSubstr("expected number of persons in slot 0: "))));
}

}  // namespace
}  // namespace eventgan
