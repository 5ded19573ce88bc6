// From the generator's volume to the chunk that the writer gets: drawn events, noise, statistics,
// codes, shuffle, deflate, checksum, each alone and all together. Items are volumes, so items a
// second are pairs a second; bytes are what the step reads. Names that begin with `plain_` are what
// the step next to them replaced, for the ratio.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "manifests/values/sensor_input.h"
#include "stages/events/drawn_events.h"
#include "stages/events/noise.h"
#include "stages/events/volume_statistics.h"
#include "stages/shards/codec/chunk_filters.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"

namespace eventgan {
namespace {

constexpr VolumeShape kShape{9, {260, 861}};

/// Like what the shipped weights make of a drive: about a tenth of the values is not zero, in
/// patches at the same place of neighbouring channels, gamma distributed with a mean of about 0.15.
std::vector<float> sparse_volume() {
  constexpr int kPatch = 6;
  std::mt19937 random(3);
  std::gamma_distribution<float> magnitude(1.3f, 0.12f);
  const ImageSize size = kShape.size;
  const int columns = size.width / kPatch + 1;
  std::vector<bool> active(static_cast<std::size_t>(columns) * (size.height / kPatch + 1));
  for (std::size_t i = 0; i < active.size(); ++i) active[i] = random() % 100 < 17;
  std::vector<float> volume(kShape.value_count());
  std::size_t next = 0;
  for (int channel = 0; channel < kShape.channels(); ++channel) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x, ++next) {
        const bool here = active[static_cast<std::size_t>(y / kPatch) * columns + x / kPatch];
        if (here && random() % 2 == 0) volume[next] = magnitude(random);
      }
    }
  }
  return volume;
}

/// Half of the values zero and none like its neighbour: what untrained weights make of any pair.
std::vector<float> dense_volume() {
  std::mt19937 random(4);
  std::normal_distribution<float> normal(0.0f, 0.3f);
  std::vector<float> volume(kShape.value_count());
  for (float& value : volume) value = std::max(0.0f, normal(random));
  return volume;
}

const std::vector<float>& volume(bool dense = false) {
  static const std::vector<float> sparse_one = sparse_volume();
  static const std::vector<float> dense_one = dense_volume();
  return dense ? dense_one : sparse_one;
}

float largest(const std::vector<float>& values) {
  return *std::max_element(values.begin(), values.end());
}

void count(benchmark::State& state, std::size_t bytes_a_volume) {
  state.SetItemsProcessed(state.iterations());
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(bytes_a_volume));
}

std::vector<std::byte> planes_of(const std::vector<float>& values, StoredType type) {
  std::vector<std::byte> planes(values.size() * stored_size(type));
  quantize(values, quantization(type, largest(values)), planes.data(), values.size());
  return planes;
}

/// Events of rates, a copy of which is a part of the time.
void draw(benchmark::State& state) {
  std::uint64_t pair = 0;
  for (auto _ : state) {
    std::vector<float> values = volume();
    draw_events(values, kShape, CounterRandom(++pair));
    benchmark::DoNotOptimize(values.data());
  }
  count(state, kShape.value_count() * sizeof(float));
}

/// The third input of a network that knows its sensor.
void third_input(benchmark::State& state) {
  std::vector<float> frames(2 * kShape.size.pixel_count());
  std::mt19937 random(5);
  for (float& x : frames) x = static_cast<float>(random() % 256) / 127.5f - 1;
  for (auto _ : state) benchmark::DoNotOptimize(sensor_input(frames, {0.25, 1.2}));
  count(state, frames.size() * sizeof(float));
}

/// Shot noise of tenths of a hertz over 0.1 s; 15 are 34,000 events.
void noise(benchmark::State& state, double hot_pixels) {
  std::vector<float> values = volume();
  const double shot_hz = 0.1 * static_cast<double>(state.range(0));
  const NoiseSpec spec{.shot_hz = {shot_hz, shot_hz}, .hot_pixels = {hot_pixels, hot_pixels}};
  std::uint64_t pair = 0;
  for (auto _ : state) {
    const NoiseRandom random{CounterRandom(1), CounterRandom(++pair)};
    benchmark::DoNotOptimize(add_noise(spec, 0.1, kShape, random, values));
  }
  count(state, values.size() * sizeof(float));
}

void statistics(benchmark::State& state, bool dense) {
  const std::vector<float>& values = volume(dense);
  for (auto _ : state) benchmark::DoNotOptimize(volume_statistics(values, kShape));
  count(state, values.size() * sizeof(float));
}

/// A pass for the check, one for the sums, a copy of the values that are not zero, partitioned.
void plain_statistics(benchmark::State& state, bool dense) {
  const std::vector<float>& values = volume(dense);
  for (auto _ : state) {
    benchmark::DoNotOptimize(first_unsound_value(values));
    double sums[2] = {};
    float top = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      sums[i >= values.size() / 2] += values[i];
      top = std::max(top, values[i]);
    }
    benchmark::DoNotOptimize(sums);
    benchmark::DoNotOptimize(top);
    std::vector<float> nonzero;
    std::copy_if(values.begin(), values.end(), std::back_inserter(nonzero),
                 [](float value) { return value != 0.0f; });
    const auto kth = nonzero.begin() + std::ptrdiff_t(0.98 * double(nonzero.size())) - 1;
    std::nth_element(nonzero.begin(), kth, nonzero.end());
    benchmark::DoNotOptimize(*kth);
  }
  count(state, values.size() * sizeof(float));
}

/// Codes in HDF5's shuffled order.
void quantize_to(benchmark::State& state, StoredType type) {
  const std::vector<float>& values = volume();
  const Quantization how = quantization(type, largest(values));
  std::vector<std::byte> planes(values.size() * stored_size(type));
  for (auto _ : state) {
    quantize(values, how, planes.data(), values.size());
    benchmark::ClobberMemory();
  }
  count(state, values.size() * sizeof(float));
}

/// One value after another, then the shuffle into a second buffer.
void plain_quantize_to_float16(benchmark::State& state) {
  const std::vector<float>& values = volume();
  for (auto _ : state) {
    std::vector<std::byte> codes(2 * values.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::uint16_t half = to_half(std::min(values[i], kLargestHalf));
      std::memcpy(codes.data() + 2 * i, &half, sizeof half);
    }
    std::vector<std::byte> shuffled(codes.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      shuffled[i] = codes[2 * i];
      shuffled[values.size() + i] = codes[2 * i + 1];
    }
    benchmark::DoNotOptimize(shuffled.data());
  }
  count(state, values.size() * sizeof(float));
}

template <class Number>
void shuffle(benchmark::State& state) {
  std::vector<Number> numbers(volume().size());
  std::memcpy(numbers.data(), volume().data(), numbers.size() * sizeof(Number));
  std::vector<std::byte> planes(numbers.size() * sizeof(Number));
  for (auto _ : state) {
    split_into_planes(std::span<const Number>(numbers), planes.data(), numbers.size());
    benchmark::ClobberMemory();
  }
  count(state, planes.size());
}

void normalize_in_place(benchmark::State& state) {
  std::vector<float> values = volume();
  const float top = eta98(values);
  for (auto _ : state) {
    normalize(values, top);
    benchmark::ClobberMemory();
  }
  count(state, values.size() * sizeof(float));
}

void deflate(benchmark::State& state, StoredType type) {
  const std::vector<std::byte> planes = planes_of(volume(), type);
  Deflater deflater(static_cast<int>(state.range(0)));
  std::size_t size = 0;
  for (auto _ : state) benchmark::DoNotOptimize(size = deflater.deflate(planes).size());
  count(state, planes.size());
  state.counters["ratio"] = double(planes.size()) / double(size);
}

void checksum(benchmark::State& state) {
  const std::vector<std::byte> codes = planes_of(volume(), StoredType::kUint8);
  for (auto _ : state) benchmark::DoNotOptimize(fletcher32(codes));
  count(state, codes.size());
}

/// Statistics and chunk, as the conversion does for every sample.
void whole_finish(benchmark::State& state, StoredType type) {
  const std::vector<float>& values = volume();
  const VolumeCodec codec(type, static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const VolumeStatistics found = volume_statistics(values, kShape).value();
    benchmark::DoNotOptimize(codec.encode(values, {kShape, kShape.size}, found.max));
  }
  count(state, values.size() * sizeof(float));
}

void deflate_levels(benchmark::internal::Benchmark* benchmark) {
  for (const int level : {1, 4, 6, 9}) benchmark->Arg(level);
  benchmark->ArgName("level")->Unit(benchmark::kMillisecond);
}

void all_levels(benchmark::internal::Benchmark* benchmark) { deflate_levels(benchmark->Arg(0)); }

constexpr auto kMilliseconds = benchmark::kMillisecond;
BENCHMARK(draw)->Unit(kMilliseconds);
BENCHMARK(third_input)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(noise, shot, 0)->Arg(1)->Arg(15)->Arg(10000)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(noise, hot_pixels, 1e-4)->Arg(0)->Arg(15)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(statistics, sparse, false)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(plain_statistics, sparse, false)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(statistics, dense, true)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(plain_statistics, dense, true)->Unit(kMilliseconds);
BENCHMARK(normalize_in_place)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(quantize_to, uint8, StoredType::kUint8)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(quantize_to, float16, StoredType::kFloat16)->Unit(kMilliseconds);
BENCHMARK(plain_quantize_to_float16)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(quantize_to, float32, StoredType::kFloat32)->Unit(kMilliseconds);
BENCHMARK(shuffle<std::uint16_t>)->Unit(kMilliseconds);
BENCHMARK(shuffle<std::uint32_t>)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(deflate, uint8, StoredType::kUint8)->Apply(deflate_levels);
BENCHMARK_CAPTURE(deflate, float16, StoredType::kFloat16)->Apply(deflate_levels);
BENCHMARK_CAPTURE(deflate, float32, StoredType::kFloat32)->Apply(deflate_levels);
BENCHMARK(checksum)->Unit(kMilliseconds);
BENCHMARK_CAPTURE(whole_finish, uint8, StoredType::kUint8)->Apply(all_levels);
BENCHMARK_CAPTURE(whole_finish, float16, StoredType::kFloat16)->Apply(all_levels);
BENCHMARK_CAPTURE(whole_finish, float32, StoredType::kFloat32)->Apply(all_levels);

}  // namespace
}  // namespace eventgan
