// Writing one shard: its samples appended, closed, hashed, fsynced and renamed. The volumes come
// encoded, as the parallel stage hands them to the one writer.

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "stages/shards/shard_writer.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

constexpr int kSamples = 16;
constexpr VolumeShape kShape{9, {260, 861}};

/// What no filter makes smaller; the writer does not look into a chunk.
std::vector<std::byte> random_bytes(std::size_t count) {
  std::minstd_rand random(7);
  std::vector<std::byte> bytes(count);
  for (std::byte& byte : bytes) byte = std::byte(random() >> 8 & 0xff);
  return bytes;
}

/// `type` uncompressed, so that a sample has all of its bytes.
void write_shard(benchmark::State& state, StoredType type) {
  const testing::TemporaryFolder folder;
  testing::ExampleShard shard = testing::unlabelled_shard();
  shard.header.volume = kShape;
  shard.header.sample_count = kSamples;
  shard.header.dtype = type;
  shard.header.deflate_level = 0;
  const std::vector<std::byte> chunk = random_bytes(kShape.value_count() * stored_size(type));
  for (auto _ : state) {
    ShardWriter writer(folder.path(), shard.header);
    for (int slot = 0; slot < kSamples; ++slot) writer.append(shard.samples[0], chunk);
    benchmark::DoNotOptimize(writer.commit());
  }
  state.SetItemsProcessed(state.iterations() * kSamples);
  state.SetBytesProcessed(state.iterations() * kSamples * std::int64_t(chunk.size()));
}

BENCHMARK_CAPTURE(write_shard, uint8, StoredType::kUint8)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write_shard, float16, StoredType::kFloat16)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write_shard, float32, StoredType::kFloat32)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eventgan
