#include "pipeline/training/records/generator_picture.h"

#include <algorithm>
#include <vector>

#include "pipeline/training/records/validation.h"
#include "stages/events/pictures/comparison_picture.h"

namespace eventgan {
namespace {

constexpr std::size_t kMostRows = 4;

}  // namespace

void write_generator_picture(const Generator& generator, std::span<const TrainingSample> samples,
                             const std::filesystem::path& file) {
  std::vector<ComparedPair> pairs;
  const std::size_t rows = std::min(samples.size(), kMostRows);
  for (std::size_t i = 0; i < rows; ++i) {
    const TrainingSample& sample = samples[i * samples.size() / rows];
    pairs.push_back({sample.shape, sample.network_frames, generated_volume(generator, sample),
                     sample.volume, sample.origin});
  }
  write_comparison_png(pairs, file);
}

}  // namespace eventgan
