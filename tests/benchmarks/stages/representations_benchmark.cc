// Events as arrays at 640x480, a million a time within 50 ms, at random pixels: no cache helps, as
// little as with events of a scene that moves as a whole. Items per second are events.
//   build/release/tests/eventgan_representations_benchmark

#include <benchmark/benchmark.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "stages/events/representation.h"

namespace eventgan {
namespace {

void BM_Represent(benchmark::State& state, const std::string& word) {
  constexpr ImageSize kSize{480, 640};
  std::mt19937 random(1);
  std::vector<Event> events(1'000'000);
  for (Event& event : events) {
    event = {static_cast<int>(random() % 640), static_cast<int>(random() % 480),
             0.05 * random() / 0xffffffff, random() % 2 == 0};
  }
  std::ranges::sort(events, {}, &Event::t_s);
  const Representation representation = parse_representation(word);
  std::vector<std::byte> values(static_cast<std::size_t>(std::max(channels_of(representation), 1)) *
                                kSize.pixel_count() * number_bytes(representation));
  for (auto _ : state) represent(events, representation, kSize, std::nullopt, values);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(events.size()));
}
BENCHMARK_CAPTURE(BM_Represent, volume, "volume:9")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Represent, voxel, "voxel:5")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Represent, histogram, "histogram:10")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Represent, count, "count")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Represent, time_surface, "time_surface:0.03")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Represent, eros, "eros:10")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eventgan
