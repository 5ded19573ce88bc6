#include "tests/stages/training/small_training.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "manifests/values/counter_random.h"

namespace eventgan::testing {
namespace {

TrainingSample moving_edge(VolumeShape shape, double start, double shift, std::string origin) {
  const auto [height, width] = shape.size;
  const std::size_t plane = shape.size.pixel_count();
  TrainingSample sample;
  sample.shape = shape;
  sample.origin = std::move(origin);
  sample.frames.resize(2 * plane);
  sample.volume.assign(shape.value_count(), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t pixel = std::size_t(y) * width + x;
      sample.frames[pixel] = float(0.8 * std::tanh(start - x));
      sample.frames[plane + pixel] = float(0.8 * std::tanh(start + shift - x));
      const double time = (x - start) / shift;
      if (time < 0 || time > 1) continue;
      // t* = (B - 1) t; each event adds max(0, 1 - |bin - t*|).
      for (int bin = 0; bin < shape.bins; ++bin) {
        const std::size_t channel = bin + (shift > 0 ? 0 : shape.bins);
        sample.volume[channel * plane + pixel] =
            float(std::max(0.0, 1 - std::abs(bin - (shape.bins - 1) * time)));
      }
    }
  }
  sample.network_frames = sample.frames;
  return sample;
}

}  // namespace

TrainingManifest small_training() {
  TrainingManifest manifest;
  manifest.name = "small";
  manifest.seed = 3;
  manifest.crop = {48, 48};
  manifest.batch = 4;
  manifest.network = {2, 4, 2, SpectralNormPlace::kDecoders, 3};
  manifest.losses.volume = 1;
  manifest.optimizer.generator_rate = 5e-3;
  manifest.optimizer.cycle_rate = 5e-3;
  manifest.optimizer.discriminator_rate = 1e-2;
  manifest.steps = {50, 50, 50};
  return manifest;
}

std::vector<TrainingSample> moving_edges(int count, VolumeShape shape, std::uint64_t seed) {
  std::vector<TrainingSample> samples;
  for (int i = 0; i < count; ++i) {
    const CounterRandom random = CounterRandom(seed).keyed(std::to_string(i));
    const double start = shape.size.width * (0.25 + 0.5 * random.uniform(0));
    const double shift = (3 + 5 * random.uniform(1)) * (random.uniform(2) < 0.5 ? -1 : 1);
    samples.push_back(
        moving_edge(shape, start, shift, "edge " + std::to_string(seed) + "." + std::to_string(i)));
  }
  return samples;
}

std::vector<TrainingSample> edge_batch(const TrainingManifest& manifest, std::uint64_t seed) {
  return moving_edges(manifest.batch, {manifest.network.bins, manifest.crop}, seed);
}

}  // namespace eventgan::testing
