#include "pipeline/calibration/calibration_samples.h"

#include <algorithm>
#include <cstdint>

namespace eventgan {
namespace {

constexpr std::int64_t kLeastShareToCalibrate = 4;  // for each sample that is held out

std::int64_t sound_count(const Plan& plan) {
  std::int64_t count = 0;
  for (const PlannedShard& shard : plan.shards) {
    count += std::ranges::count_if(
        shard.samples, [](const PlannedSample& sample) { return sample.fault.empty(); });
  }
  return count;
}

}  // namespace

std::vector<CalibrationSample> choose_calibration_samples(const Plan& plan, int pairs,
                                                          int held_out) {
  const std::int64_t sound = sound_count(plan);
  const std::int64_t held = std::min<std::int64_t>(held_out, sound / (kLeastShareToCalibrate + 1));
  const std::int64_t chosen = held + std::min<std::int64_t>(pairs, sound - held);
  std::vector<CalibrationSample> samples;
  std::int64_t number = 0;  // among the sound ones
  for (const PlannedShard& shard : plan.shards) {
    for (std::size_t slot = 0; slot < shard.samples.size(); ++slot) {
      if (!shard.samples[slot].fault.empty()) continue;
      const std::int64_t k = std::ssize(samples);
      if (k < chosen && number++ == k * sound / chosen) {
        const bool is_held_out = (k + 1) * held / chosen > k * held / chosen;
        samples.push_back({&shard, static_cast<int>(slot), is_held_out});
      }
    }
  }
  return samples;
}

}  // namespace eventgan
