#include "pipeline/finalization/dataset_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "manifests/faults.h"
#include "tests/pipeline/finalization/converted_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using testing::ConvertedFolder;
using testing::ExampleShard;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

TEST(DatasetParts, AreThePlansShardsAndAHeaderOfEachSource) {
  const ConvertedFolder folder;
  const DatasetParts parts = read_dataset_parts(folder.path());
  EXPECT_THAT(parts.missing, IsEmpty());
  ASSERT_EQ(parts.shards.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    const FinishedShard& shard = parts.shards[static_cast<std::size_t>(i)];
    EXPECT_EQ(shard.outline.name, folder.shard(i).filename());
    EXPECT_EQ(shard.marker, folder.marker(i));
  }
  EXPECT_EQ(parts.headers.size(), 3u);
  EXPECT_EQ(parts.headers.at(1).name, "demo-val-00000-of-00001.h5");
  EXPECT_EQ(parts.source_of(parts.shards[1].outline).split, "val");
  EXPECT_THAT(parts.amendments, IsEmpty());
}

TEST(DatasetParts, WhatIsNotDoneIsNamedWithTheReason) {
  const ConvertedFolder folder(3);
  std::filesystem::remove(folder.marker_file(0));
  testing::write_file(folder.shard(1), "short");
  const DatasetParts parts = read_dataset_parts(folder.path());
  EXPECT_EQ(parts.shards.size(), 1u);
  ASSERT_EQ(parts.missing.size(), 3u);
  EXPECT_EQ(parts.missing[0].name, "demo-train-00000-of-00003.h5");
  EXPECT_THAT(parts.missing[0].why, HasSubstr("not committed"));
  EXPECT_THAT(parts.missing[1].why, HasSubstr("expected size in bytes"));
  EXPECT_EQ(parts.missing[2].why, "missing");
}

TEST(DatasetParts, AFolderWithoutAPlan) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(read_dataset_parts(folder.path()), InputError);
}

TEST(DatasetParts, AShardThatIsNotWhatThePlanSaysIsRefused) {
  const auto expect_refusal = [](void (*change)(ExampleShard&), const char* what) {
    ConvertedFolder folder;
    folder.add(1, change);
    EXPECT_THAT([&] { read_dataset_parts(folder.path()); },
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

TEST(DatasetParts, AFileThatIsNoShardIsNamed) {
  const ConvertedFolder folder;
  const auto size = std::filesystem::file_size(folder.shard(0));
  testing::write_file(folder.shard(0), std::string(size, 'x'));
  EXPECT_THAT([&] { read_dataset_parts(folder.path()); },
              ThrowsMessage<std::runtime_error>(HasSubstr(folder.shard(0).string())));
}

}  // namespace
}  // namespace eventgan
