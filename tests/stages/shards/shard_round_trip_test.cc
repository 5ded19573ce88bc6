// A shard is read back as it was written: ShardWriter with ShardReader.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_writer.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"

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
  }
  ASSERT_EQ(got.persons.size(), expected.persons.size());
  for (std::size_t i = 0; i < got.persons.size(); ++i) {
    EXPECT_EQ(got.persons[i].joints, expected.persons[i].joints);
    EXPECT_EQ(got.persons[i].center, expected.persons[i].center);
    EXPECT_EQ(got.persons[i].scale, expected.persons[i].scale);
    EXPECT_EQ(got.persons[i].head_box, expected.persons[i].head_box);
    EXPECT_EQ(got.persons[i].camera, expected.persons[i].camera);
  }
}

/// All fields; `fault` is in the marker, and times are relative.
void expect_same(const ShardSample& got, const ShardSample& expected) {
  EXPECT_EQ(got.valid, expected.valid);
  EXPECT_EQ(got.sample_id, expected.sample_id);
  EXPECT_EQ(got.sequence, expected.sequence);
  EXPECT_EQ(got.pair.previous, expected.pair.previous);
  EXPECT_EQ(got.pair.next, expected.pair.next);
  EXPECT_EQ(got.pair.gap_frames, expected.pair.gap_frames);
  EXPECT_THAT(got.pair.gap_s(), ::testing::NanSensitiveDoubleEq(expected.pair.gap_s()));
  EXPECT_EQ(got.pair.label_index, expected.pair.label_index);
  EXPECT_EQ(got.pair.label_position, expected.pair.label_position);
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
  EXPECT_EQ(got.annotation, expected.annotation);
  expect_same(got.labels, expected.labels);
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

}  // namespace
}  // namespace eventgan
