// A shard that is read row by row and chunk by chunk and written again has the same bytes: what a
// retry does with the samples it leaves as they are.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_writer.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using testing::ExampleShard;
using testing::TemporaryFolder;

void expect_same_copy(const ExampleShard& example) {
  const TemporaryFolder folder;
  const ShardMarker marker = write_shard(folder.path(), example);
  const std::filesystem::path copies = folder / "copies";
  std::filesystem::create_directory(copies);
  const ShardReader reader(folder / marker.shard);
  ShardWriter writer(copies, reader.header());
  for (int slot = 0; slot < reader.header().sample_count; ++slot) {
    writer.append(reader.sample(slot), reader.stored_chunk(slot));
  }
  EXPECT_EQ(writer.commit().sha256, marker.sha256);
  EXPECT_EQ(testing::read_file(copies / marker.shard), testing::read_file(folder / marker.shard));
}

TEST(ShardCopy, HasTheSameBytes) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    for (const int level : {0, 1, 9}) expect_same_copy(testing::example_shard(type, level));
  }
}

TEST(ShardCopy, OfASourceWithoutLabelsHasTheSameBytes) {
  expect_same_copy(testing::unlabelled_shard());
}

TEST(ShardCopy, OfNothingButQuarantinedSamplesHasTheSameBytes) {
  ExampleShard example = testing::example_shard();
  example.samples = {example.samples[2], example.samples[2]};
  example.volumes = {{}, {}};
  example.header.sample_count = 2;
  expect_same_copy(example);
}

TEST(StoredChunk, IsWhatWasWritten) {
  const TemporaryFolder folder;
  const ExampleShard example = testing::example_shard(StoredType::kUint8, 9);
  write_shard(folder.path(), example);
  const ShardReader reader(folder / example.header.name);
  const VolumeCodec codec(StoredType::kUint8, 9);
  for (const int slot : {0, 1, 3, 4}) {
    EXPECT_EQ(reader.stored_chunk(slot),
              codec.encode(example.volumes[static_cast<std::size_t>(slot)]).chunk);
  }
  EXPECT_TRUE(reader.stored_chunk(2).empty()) << "quarantined: nothing was written";
  EXPECT_THROW(reader.stored_chunk(5), std::out_of_range);
  EXPECT_THROW(reader.stored_chunk(-1), std::out_of_range);
}

TEST(StoredChunk, OfDamagedBytesIsNotHandedOn) {
  const TemporaryFolder folder;
  const ExampleShard example = testing::example_shard(StoredType::kUint8, 9);
  write_shard(folder.path(), example);
  const std::filesystem::path file = folder / example.header.name;
  const std::vector<std::byte> chunk = ShardReader(file).stored_chunk(1);
  std::string bytes = testing::read_file(file);
  const std::size_t at = bytes.find({reinterpret_cast<const char*>(chunk.data()), chunk.size()});
  ASSERT_NE(at, bytes.npos);
  bytes[at + chunk.size() / 2] ^= 1;
  testing::write_file(file, bytes);
  const ShardReader reader(file);
  EXPECT_FALSE(reader.stored_chunk(0).empty());
  EXPECT_THAT([&] { reader.stored_chunk(1); },
              ::testing::ThrowsMessage<std::runtime_error>(::testing::AllOf(
                  ::testing::HasSubstr(file.string()), ::testing::HasSubstr("/events/volume[1]"))));
}

}  // namespace
}  // namespace eventgan
