// Training pairs simulated on the fly: scenes of moving planes over photographs' stand-ins of
// 640x480, each iteration another scene of the same 64. Items per second are pairs.
//   build/release/tests/eventgan_simulation_benchmark

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "stages/events/simulation/moving_planes.h"

namespace eventgan {
namespace {

/// Waves of all lengths, longer ones stronger, as in photographs.
GreyImage waves(ImageSize size, double turn) {
  GreyImage image{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      double sum = 0;
      for (int octave = 1; octave <= 8; ++octave) {
        const double scale = std::exp2(-octave);
        const double angle = turn + octave;
        sum += scale * std::sin((x * std::cos(angle) + y * std::sin(angle)) * 0.01 / scale + angle);
      }
      image.pixels.push_back(static_cast<std::uint8_t>(std::lround(127.5 + 120 * sum)));
    }
  }
  return image;
}

void BM_SimulatePlanes(benchmark::State& state) {
  const int side = static_cast<int>(state.range(0));
  const std::vector<GreyImage> textures = {waves({480, 640}, 0), waves({480, 640}, 1),
                                           waves({480, 640}, 2)};
  std::uint64_t scene = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(simulate_planes(textures, {side, side}, CounterRandom(scene++ % 64)));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_SimulatePlanes)->Arg(128)->Arg(256)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eventgan
