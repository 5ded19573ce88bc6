#pragma once

#include <cstdint>
#include <vector>

#include "manifests/values/training.h"
#include "stages/training/training_sample.h"

namespace eventgan::testing {

/// A job that takes milliseconds a step: networks of base width 2 (discriminator 4), 3 bins, crop
/// 48x48, batch 4, rates high enough to learn in 50 steps.
TrainingManifest small_training();

/// Pairs of frames of a soft vertical edge that moves by up to 8 pixels, bright side first, and the
/// volume of the pixels it sweeps: value 1, at the time the edge passes, positive where it gets
/// brighter. A function of the seed. Origins are "edge SEED.INDEX".
std::vector<TrainingSample> moving_edges(int count, VolumeShape shape, std::uint64_t seed);

/// moving_edges as this job's batch.
std::vector<TrainingSample> edge_batch(const TrainingManifest& manifest, std::uint64_t seed);

}  // namespace eventgan::testing
