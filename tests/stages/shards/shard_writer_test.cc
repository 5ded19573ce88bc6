#include "stages/shards/shard_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <random>
#include <set>

#include "manifests/files/sha256.h"
#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/detail/shard_objects.h"
#include "stages/shards/shard_reader.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using testing::example_shard;
using testing::ExampleShard;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::names_in;
using testing::read_file;
using testing::TemporaryFolder;
using testing::unlabelled_shard;

constexpr VolumeUnit kUnits[] = {VolumeUnit::kLearned, VolumeUnit::kEvents, VolumeUnit::kDrawn,
                                 VolumeUnit::kRates};

TEST(VolumeWords, NameEachUnitDifferently) {
  std::set<std::string> texts;
  for (const Normalization normalization : {Normalization::kNone, Normalization::kEta98}) {
    for (const VolumeUnit unit : kUnits) texts.insert(unit_text(unit, normalization));
  }
  EXPECT_EQ(texts.size(), 7u);  // a network's normalised volumes are dimensionless either way
}

TEST(VolumeWords, AreThoseOfEarlierShards) {
  // Shards hold these; a change is a change of the format.
  EXPECT_EQ(unit_text(VolumeUnit::kLearned, Normalization::kNone),
            "dimensionless, >= 0; not a count of events");
  EXPECT_EQ(time_axis_text(VolumeUnit::kLearned),
            "bin b of a polarity is centred at time b / (bins - 1), where 0 is the previous frame "
            "and 1 the next one");
  // Only a simulator's first and last event span the bins.
  for (const VolumeUnit unit : kUnits) {
    EXPECT_EQ(time_axis_text(unit) == time_axis_text(VolumeUnit::kLearned),
              unit != VolumeUnit::kEvents);
  }
}

TEST(VolumeWords, GoThroughAShard) {
  for (const Normalization normalization : {Normalization::kNone, Normalization::kEta98}) {
    for (const VolumeUnit unit : kUnits) {
      const testing::TemporaryFolder folder;
      testing::ExampleShard example = testing::example_shard();
      example.header.unit = unit;
      example.header.normalization = normalization;
      testing::write_shard(folder.path(), example);
      EXPECT_EQ(ShardReader(folder / example.header.name).header().unit, unit);
    }
  }
}

std::vector<std::byte> chunk_of(const ExampleShard& example, std::size_t slot) {
  return VolumeCodec(example.header.dtype, example.header.deflate_level)
      .encode(example.volumes[slot])
      .chunk;
}

TEST(ShardWriter, TheFileAppearsAtCommit) {
  const TemporaryFolder folder;
  const ExampleShard example = unlabelled_shard();
  ShardWriter writer(folder.path(), example.header);
  writer.append(example.samples[0], chunk_of(example, 0));
  EXPECT_FALSE(std::filesystem::exists(folder / example.header.name));
  const ShardReceipt receipt = writer.commit();
  EXPECT_THAT(names_in(folder.path()), ElementsAre(example.header.name));
  const std::string bytes = read_file(folder / example.header.name);
  EXPECT_EQ(receipt.size_bytes, static_cast<std::int64_t>(bytes.size()));
  EXPECT_EQ(receipt.sha256, sha256_hex(bytes));
}

TEST(ShardWriter, WithoutCommitNothingStays) {
  const TemporaryFolder folder;
  const ExampleShard example = unlabelled_shard();
  {
    ShardWriter writer(folder.path(), example.header);
    writer.append(example.samples[0], chunk_of(example, 0));
    EXPECT_EQ(names_in(folder.path()).size(), 1u);
  }
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
}

TEST(ShardWriter, AFileThatSomeoneDeletedUnderWayIsNamed) {
  const TemporaryFolder folder;
  const ExampleShard example = unlabelled_shard();
  ShardWriter writer(folder.path(), example.header);
  writer.append(example.samples[0], chunk_of(example, 0));
  std::filesystem::remove(folder / names_in(folder.path()).at(0));
  EXPECT_THROWS(writer.commit(), UnfinishedShardLost, (folder / example.header.name).string());
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
}

TEST(ShardWriter, ReplacesAnOlderShard) {
  const TemporaryFolder folder;
  const ExampleShard example = unlabelled_shard();
  testing::write_file(folder / example.header.name, "older");
  const CommitRecord record = write_shard(folder.path(), example);
  EXPECT_EQ(sha256_of_file(folder / example.header.name), record.sha256);
}

TEST(ShardWriter, SameSamplesSameBytes) {
  const ExampleShard example = example_shard();
  const TemporaryFolder first;
  write_shard(first.path(), example);
  const std::string bytes = read_file(first / example.header.name);
  // Memory that was used before: bytes that the writer or HDF5 never set would show.
  for (const int filling : {0x55, 0xaa}) {
    const TemporaryFolder second;
    ::mallopt(M_PERTURB, filling);
    write_shard(second.path(), example);
    ::mallopt(M_PERTURB, 0);
    EXPECT_TRUE(read_file(second / example.header.name) == bytes) << filling;
  }
}

TEST(ShardWriter, BytesDoNotDependOnTheFolderOrOnWhatElseIsOpen) {
  const ExampleShard example = example_shard();
  const TemporaryFolder first, second;
  std::filesystem::create_directory(second / "a folder with a longer name");
  write_shard(first.path(), example);
  const ShardReader other(first / example.header.name);
  const auto folder = second / "a folder with a longer name";
  write_shard(folder, example);
  EXPECT_TRUE(read_file(first / example.header.name) == read_file(folder / example.header.name));
}

TEST(ShardWriter, AllSamplesCanBeQuarantined) {
  const TemporaryFolder folder;
  ExampleShard example = unlabelled_shard();
  example.samples[0].valid = false;
  write_shard(folder.path(), example);
  const ShardReader reader(folder / example.header.name);
  EXPECT_FALSE(reader.sample(0).valid);
  EXPECT_EQ(reader.volume(0), std::vector<float>(example.header.volume.value_count()));
}

TEST(ShardWriter, AQuarantinedSampleMayComeWithoutMappedLabels) {
  const TemporaryFolder folder;
  ExampleShard example = example_shard();
  example.samples[0].valid = false;
  example.samples[0].labels = {};
  write_shard(folder.path(), example);
  const ShardReader reader(folder / example.header.name);
  EXPECT_EQ(reader.sample(0).annotation.original, example.samples[0].annotation.original);
  EXPECT_TRUE(reader.sample(0).annotation.boxes.empty());
  EXPECT_EQ(reader.sample(3).annotation, example.samples[3].annotation);
}

TEST(ShardWriter, WrongUseIsALogicError) {
  const TemporaryFolder folder;
  ExampleShard example = unlabelled_shard();
  const std::vector<std::byte> chunk = chunk_of(example, 0);
  ShardSample sample = example.samples[0];
  ShardWriter writer(folder.path(), example.header);
  EXPECT_THROWS(writer.commit(), std::logic_error,
                "expected 1 samples, got 0, in demo-train-00000-of-00001.h5")
      << "a slot is missing";
  EXPECT_THROWS(writer.append(sample, {}), std::logic_error,
                "expected a volume for a valid sample and none for another")
      << "valid without a volume";

  ShardSample invalid = sample;
  invalid.valid = false;
  EXPECT_THROWS(writer.append(invalid, chunk), std::logic_error,
                "expected a volume for a valid sample and none for another")
      << "a volume, but not valid";

  ShardSample unmapped = sample;
  unmapped.annotation.boxes.resize(1);
  EXPECT_THROWS(writer.append(unmapped, chunk), std::logic_error,
                "expected a volume box for each annotated box (000000)")
      << "boxes without volume boxes";
  unmapped.labels.boxes.resize(1);
  EXPECT_THROWS(writer.append(unmapped, chunk), std::logic_error,
                "expected class ids that the schema names (000000)")
      << "a class without a name";

  ShardSample jointed = sample;
  jointed.annotation.persons.resize(1);
  jointed.labels.persons.resize(1);
  jointed.annotation.persons[0].joints.resize(2);
  jointed.labels.persons[0].joints.resize(2);
  EXPECT_THROWS(writer.append(jointed, chunk), std::logic_error,
                "expected a joint for each name in the schema (000000)")
      << "joints without names";

  writer.append(sample, chunk);
  EXPECT_THROWS(writer.append(sample, chunk), std::logic_error,
                "expected no sample after the last slot, got one (000000")
      << "one too many";
  writer.commit();
  EXPECT_THROWS(writer.commit(), std::logic_error,
                "a shard is committed once: demo-train-00000-of-00001.h5")
      << "twice";
  EXPECT_EQ(ShardReader(folder / example.header.name).header().sample_count, 1);
}

TEST(ShardWriter, RefusesVolumesThatHdf5CannotChunk) {
  const TemporaryFolder folder;
  ShardHeader header = unlabelled_shard().header;
  header.volume = {9, {8000, 8000}};  // 18 x 64e6 x 4 bytes = 4.6e9 > 2^32
  EXPECT_THROWS(ShardWriter(folder.path(), header), std::invalid_argument,
                "expected volumes below 4 GiB, got 4608000000 bytes");
  header.volume = {9, {0, 8}};
  EXPECT_THROWS(ShardWriter(folder.path(), header), std::invalid_argument,
                "expected samples and a volume with values");
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
}

TEST(ShardWriter, NamesAFolderItCannotWriteTo) {
  const TemporaryFolder folder;
  try {
    ShardWriter(folder / "absent", unlabelled_shard().header);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr((folder / "absent").string()),
                                    HasSubstr("No such file or directory")));
  }
}

/// A shard of four volumes that do not compress, of about 41,000 bytes each.
void write_noise(const std::filesystem::path& folder) {
  ExampleShard example = unlabelled_shard();
  example.header.volume = {2, {50, 51}};
  example.header.sample_count = 4;
  std::mt19937 random(7);
  std::vector<float> noise(example.header.volume.value_count());
  for (float& value : noise) value = static_cast<float>(random());
  ShardWriter writer(folder, example.header);
  const VolumeCodec codec(StoredType::kFloat32, 0);
  for (int i = 0; i < 4; ++i) writer.append(example.samples[0], codec.encode(noise).chunk);
  writer.commit();
}

TEST(ShardWriter, AFullDiskLeavesNothingAndTheProgramEndsInPeace) {
  const TemporaryFolder whole;
  write_noise(whole.path());
  const std::string name = names_in(whole.path()).at(0);
  const std::size_t size = std::filesystem::file_size(whole / name);
  // At the very start, within the volumes, and in what HDF5 only writes when it closes the file.
  for (const std::size_t limit : {std::size_t{10}, size / 4, size / 2, size - 5000, size - 1}) {
    const TemporaryFolder folder;
    const std::string error =
        testing::error_on_full_disk(limit, [&] { write_noise(folder.path()); });
    EXPECT_THAT(error, AllOf(HasSubstr("cannot write " + (folder / ".").string()), HasSubstr(name),
                             HasSubstr("File too large")))
        << limit << " of " << size;
    EXPECT_THAT(names_in(folder.path()), IsEmpty()) << limit << " of " << size;
  }
  const TemporaryFolder folder;
  // HDF5 takes a little more while it writes than it keeps.
  EXPECT_EQ(testing::error_on_full_disk(2 * size, [&] { write_noise(folder.path()); }), "no error");
}

TEST(ShardWriter, AfterAFullDiskTheNextShardCanBeWritten) {
  const TemporaryFolder folder;
  const std::string error = testing::error_on_full_disk(60000, [&] {
    try {
      write_noise(folder.path());
    } catch (const std::runtime_error&) {
      write_shard(folder.path(), unlabelled_shard());  // small enough
      throw;
    }
  });
  EXPECT_THAT(error, HasSubstr("File too large"));
  const ShardReader reader(folder / unlabelled_shard().header.name);
  EXPECT_EQ(reader.volume(0), unlabelled_shard().volumes[0]);
}

}  // namespace
}  // namespace eventgan
