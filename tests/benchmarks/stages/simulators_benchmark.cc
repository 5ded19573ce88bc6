// The simulators that stand in the network's place, from two prepared frames to their volume, of
// frames made here: smooth shades, edges and sensor noise, a few pixels apart. Items are pairs.
//   build/release/tests/eventgan_simulators_benchmark

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "manifests/values/events.h"
#include "pipeline/generators/simulated_generator.h"

namespace eventgan {
namespace {

constexpr VolumeShape kShape{9, {260, 861}};

/// A street in [-1, 1], `moved` pixels to the left.
cv::Mat street(int moved) {
  cv::Mat image(kShape.size.height, kShape.size.width, CV_32FC1);
  for (int y = 0; y < image.rows; ++y) image.row(y).setTo(200 - 0.4 * y);
  cv::RNG houses(7);
  for (int i = 0; i < 1500; ++i) {
    const cv::Point corner(houses.uniform(-50, 1000) - moved, houses.uniform(20, 240));
    const cv::Size side(houses.uniform(2, 40), houses.uniform(2, 25));
    cv::rectangle(image, cv::Rect(corner, side), houses.uniform(10.0, 240.0), cv::FILLED);
  }
  cv::Mat noise(image.size(), image.type());
  cv::RNG sensor(static_cast<std::uint64_t>(moved) + 1);
  sensor.fill(noise, cv::RNG::NORMAL, 0, 2);
  image += noise;
  cv::GaussianBlur(image, image, cv::Size(3, 3), 0);
  cv::min(cv::max(image, 0), 255, image);
  return image / 127.5 - 1;
}

void simulate(benchmark::State& state, GeneratorKind kind) {
  constexpr int kPairs = 8;  // the affine motions of ESIM differ in size
  std::vector<std::vector<float>> pairs;
  for (int i = 0; i < kPairs; ++i) {
    pairs.emplace_back();
    for (const int moved : {5 * i, 5 * i + 5}) {
      const cv::Mat frame = street(moved);
      pairs.back().insert(pairs.back().end(), frame.begin<float>(), frame.end<float>());
    }
  }
  GeneratorSpec spec;
  spec.kind = kind;
  const auto generator = make_simulated_generator(spec, kShape.bins, 1);
  std::vector<float> volume(kShape.value_count());
  double events = 0;
  for (const auto& frames : pairs) {
    generator->generate({frames, kShape.size}, volume);
    events += std::accumulate(volume.begin(), volume.end(), 0.0);
  }
  std::size_t pair = 0;
  for (auto _ : state) {
    generator->generate({pairs[pair++ % kPairs], kShape.size}, volume);
    benchmark::DoNotOptimize(volume.data());
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["events"] = events / kPairs;
}

void difference(benchmark::State& state) { simulate(state, GeneratorKind::kDifference); }
BENCHMARK(difference)->Unit(benchmark::kMillisecond);

void esim(benchmark::State& state) { simulate(state, GeneratorKind::kEsim); }
BENCHMARK(esim)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eventgan
