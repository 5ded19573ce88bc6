#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_writer.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

// A shard is read back as it was written: ShardWriter with ShardReader.

// A shard that is read row by row and chunk by chunk and written again has the same bytes: what a
// retry does with the samples it leaves as they are.

namespace eventgan {
namespace {

using testing::example_shard;
using testing::ExampleShard;
using testing::TemporaryFolder;

void expect_same(const ShardHeader& got, const ShardHeader& expected) {
  EXPECT_EQ(got.name, expected.name);
  EXPECT_EQ(got.dataset, expected.dataset);
  EXPECT_EQ(got.split, expected.split);
  EXPECT_EQ(got.sample_count, expected.sample_count);
  EXPECT_EQ(got.volume, expected.volume);
  EXPECT_EQ(got.dtype, expected.dtype);
  EXPECT_EQ(got.deflate_level, expected.deflate_level);
  EXPECT_EQ(got.normalization, expected.normalization);
  EXPECT_EQ(got.label_schema, expected.label_schema);
  EXPECT_EQ(got.preprocessing, expected.preprocessing);
  EXPECT_EQ(got.plan_hash, expected.plan_hash);
  EXPECT_EQ(got.manifest_text, expected.manifest_text);
  EXPECT_EQ(got.scope, expected.scope);
  EXPECT_EQ(got.tile_px, expected.tile_px);
  EXPECT_EQ(got.weights, expected.weights);
  EXPECT_EQ(got.weights_hash, expected.weights_hash);
  EXPECT_EQ(got.generator, expected.generator);
  EXPECT_EQ(got.program_version, expected.program_version);
}

void expect_same(const VolumeLabels& got, const VolumeLabels& expected) {
  ASSERT_EQ(got.boxes.size(), expected.boxes.size());
  for (std::size_t i = 0; i < got.boxes.size(); ++i) {
    EXPECT_EQ(got.boxes[i].clipped, expected.boxes[i].clipped);
    EXPECT_EQ(got.boxes[i].unclipped, expected.boxes[i].unclipped);
    EXPECT_EQ(got.boxes[i].ignore, expected.boxes[i].ignore);
    EXPECT_EQ(got.boxes[i].outline, expected.boxes[i].outline);
  }
  ASSERT_EQ(got.persons.size(), expected.persons.size());
  for (std::size_t i = 0; i < got.persons.size(); ++i) {
    EXPECT_EQ(got.persons[i].joints, expected.persons[i].joints);
    EXPECT_EQ(got.persons[i].center, expected.persons[i].center);
    EXPECT_EQ(got.persons[i].scale, expected.persons[i].scale);
    EXPECT_EQ(got.persons[i].head_box, expected.persons[i].head_box);
    EXPECT_EQ(got.persons[i].box, expected.persons[i].box);
    EXPECT_EQ(got.persons[i].camera, expected.persons[i].camera);
  }
  EXPECT_EQ(got.projection, expected.projection);
}

/// All fields; `fault` is in the commit record.
void expect_same(const ShardSample& got, const ShardSample& expected) {
  EXPECT_EQ(got.valid, expected.valid);
  EXPECT_EQ(got.sample_id, expected.sample_id);
  EXPECT_EQ(got.sequence, expected.sequence);
  EXPECT_EQ(got.origin, expected.origin);
  EXPECT_THAT(got.pair.previous.time_s,
              ::testing::NanSensitiveDoubleEq(expected.pair.previous.time_s));
  EXPECT_EQ(got.pair.previous, expected.pair.previous);
  EXPECT_EQ(got.pair.next, expected.pair.next);
  EXPECT_EQ(got.pair.gap_frames, expected.pair.gap_frames);
  EXPECT_THAT(got.pair.gap_s(), ::testing::NanSensitiveDoubleEq(expected.pair.gap_s()));
  EXPECT_EQ(got.pair.label_index, expected.pair.label_index);
  EXPECT_EQ(got.pair.label_position, expected.pair.label_position);
  EXPECT_EQ(got.pair.motion, expected.pair.motion);
  EXPECT_EQ(got.threshold, expected.threshold);
  EXPECT_EQ(got.source_size, expected.source_size);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_THAT(got.source_to_volume[i],
                ::testing::NanSensitiveDoubleEq(expected.source_to_volume[i]));
  }
  EXPECT_EQ(got.statistics.eta98, expected.statistics.eta98);
  EXPECT_EQ(got.statistics.max, expected.statistics.max);
  EXPECT_EQ(got.statistics.nonzero_fraction, expected.statistics.nonzero_fraction);
  EXPECT_EQ(got.statistics.sum_positive, expected.statistics.sum_positive);
  EXPECT_EQ(got.statistics.sum_negative, expected.statistics.sum_negative);
  EXPECT_EQ(got.statistics.flags, expected.statistics.flags);
  EXPECT_EQ(got.tiles, expected.valid ? expected.tiles : std::vector<std::uint8_t>(4));
  EXPECT_EQ(got.annotation, expected.annotation);
  expect_same(got.labels, expected.labels);
  EXPECT_EQ(got.flow, expected.flow);
}

TEST(ShardRoundTrip, EveryFieldComesBack) {
  const TemporaryFolder folder;
  const ExampleShard example = example_shard();
  write_shard(folder.path(), example);
  const ShardReader reader(folder / example.header.name);
  expect_same(reader.header(), example.header);
  for (int slot = 0; slot < example.header.sample_count; ++slot) {
    SCOPED_TRACE(slot);
    expect_same(reader.sample(slot), example.samples[static_cast<std::size_t>(slot)]);
  }
}

TEST(ShardRoundTrip, VolumesComeBackAsTheirTypeAllows) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    for (const int level : {0, 1, 9}) {
      const TemporaryFolder folder;
      const ExampleShard example = example_shard(type, level);
      write_shard(folder.path(), example);
      const ShardReader reader(folder / example.header.name);
      EXPECT_EQ(reader.header().deflate_level, level);
      for (const int slot : {0, 1, 3, 4}) {
        const std::vector<float>& expected = example.volumes[static_cast<std::size_t>(slot)];
        const std::vector<float> got = reader.volume(slot);
        ASSERT_EQ(got.size(), expected.size());
        for (std::size_t i = 0; i < got.size(); ++i) {
          // float16: half a unit in the last of 11 bits; uint8: half a step of scale.
          const float tolerance = type == StoredType::kFloat32 ? 0
                                  : type == StoredType::kFloat16
                                      ? expected[i] * 0x1p-11f
                                      : reader.sample(slot).scale * 0.5001f;
          ASSERT_NEAR(got[i], expected[i], tolerance);
        }
      }
      EXPECT_EQ(reader.volume(2), std::vector<float>(example.header.volume.value_count()))
          << "a quarantined slot";
    }
  }
}

TEST(ShardRoundTrip, ASourceWithoutLabels) {
  const TemporaryFolder folder;
  const ExampleShard example = testing::unlabelled_shard();
  write_shard(folder.path(), example);
  const ShardReader reader(folder / example.header.name);
  expect_same(reader.header(), example.header);
  expect_same(reader.sample(0), example.samples[0]);
  EXPECT_EQ(reader.volume(0), example.volumes[0]);
}

TEST(ShardRoundTrip, OutlinesOfEverySizeComeBackInFloat32) {
  const TemporaryFolder folder;
  ExampleShard example = example_shard();
  VolumeBox& box = example.samples[3].labels.boxes[0];
  auto& ring = box.outline.rings.emplace_back();
  constexpr int kCorners = 100'000;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2 * M_PI * i / kCorners;
    ring.push_back({6 + 3 * std::cos(angle), 1 + 1e6 * std::sin(angle)});
  }
  example.samples[0].labels.boxes[1].outline = {{{{0, 0}, {1e-9, 0}, {0, 1.0 / 3}}}};
  write_shard(folder.path(), example);
  const ShardReader reader(folder / example.header.name);
  for (const int slot : {0, 3}) {
    const auto& boxes = example.samples[static_cast<std::size_t>(slot)].labels.boxes;
    const ShardSample got = reader.sample(slot);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      Outline expected = boxes[i].outline;
      for (auto& corners : expected.rings) {
        for (Point& corner : corners) {
          corner = {static_cast<float>(corner.x), static_cast<float>(corner.y)};
        }
      }
      EXPECT_TRUE(got.labels.boxes[i].outline == expected) << slot << " " << i;
    }
  }
}

TEST(ShardRoundTrip, AShardWithoutOutlinesHasNoColumnOfThem) {
  const TemporaryFolder folder;
  ExampleShard example = example_shard();
  example.samples[0].labels.boxes[0].outline = {};
  const CommitRecord record = write_shard(folder.path(), example);
  EXPECT_THAT(record.contents.optional_columns,
              ::testing::Not(::testing::Contains("/labels/boxes/outline")));
  const ShardReader reader(folder / example.header.name);
  EXPECT_THAT(reader.header().features, ::testing::Not(::testing::Contains("outlines")));
  EXPECT_TRUE(reader.sample(0).labels.boxes[0].outline.empty());
  EXPECT_TRUE(reader.sample(0).annotation.boxes[0].outline.empty());
}

TEST(ShardRoundTrip, MoreRowsThanAChunkOfAColumn) {
  const TemporaryFolder folder;
  ExampleShard example = testing::unlabelled_shard();
  example.header.volume = {1, {1, 1}};
  const VolumeCodec codec(example.header.dtype, example.header.deflate_level);
  example.header.sample_count = 5000;
  ShardWriter writer(folder.path(), example.header);
  for (int i = 0; i < 5000; ++i) {
    ShardSample sample = example.samples[0];
    sample.pair.label_index = 3 * i;
    writer.append(sample, codec.encode(std::vector<float>(2, static_cast<float>(i))).chunk);
  }
  writer.commit();
  const ShardReader reader(folder / example.header.name);
  for (const int slot : {0, 4095, 4096, 4999}) {
    EXPECT_EQ(reader.sample(slot).pair.label_index, 3 * slot);
    EXPECT_EQ(reader.volume(slot), std::vector<float>(2, static_cast<float>(slot)));
  }
}

void expect_same_copy(const ExampleShard& example) {
  const TemporaryFolder folder;
  const CommitRecord record = write_shard(folder.path(), example);
  const std::filesystem::path copies = folder / "copies";
  std::filesystem::create_directory(copies);
  const ShardReader reader(folder / record.shard);
  ShardWriter writer(copies, reader.header());
  for (int slot = 0; slot < reader.header().sample_count; ++slot) {
    writer.append(reader.sample(slot), reader.stored_chunk(slot));
  }
  EXPECT_EQ(writer.commit().sha256, record.sha256);
  EXPECT_EQ(testing::read_file(copies / record.shard), testing::read_file(folder / record.shard));
}

TEST(ShardCopy, HasTheSameBytesWithoutLabelsToo) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    for (const int level : {0, 1, 9}) expect_same_copy(testing::example_shard(type, level));
  }
  expect_same_copy(testing::unlabelled_shard());
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
  EXPECT_THROWS(reader.stored_chunk(5), std::out_of_range, "expected a sample 0..4, got 5");
  EXPECT_THROWS(reader.stored_chunk(-1), std::out_of_range, "expected a sample 0..4, got -1");
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
  EXPECT_THROWS(reader.stored_chunk(1), std::runtime_error, file.string(), "/events/volume[1]");
}

}  // namespace
}  // namespace eventgan
