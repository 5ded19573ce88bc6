#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "manifests/training_manifest.h"
#include "pipeline/training/samples/training_recording.h"
#include "stages/training/augmentation.h"

namespace eventgan {

/// Which sample of a training: the `index`-th of the batch of `step` in `phase`.
struct SamplePlace {
  TrainingPhase phase = TrainingPhase::kFlow;
  std::int64_t step = 0;
  int index = 0;
};

/// What is drawn for one sample.
struct SampleDraw {
  std::size_t recording = 0;
  std::int64_t first_frame = 0;
  std::int64_t last_frame = 0;  ///< first_frame: one frame twice, without events
  Augmentation augmentation;
};

/// Draws a sample: recording by weight; then, with probability static_fraction, one frame twice;
/// else the gap uniformly from those of the manifest that fit the recording's part in use, and the
/// first frame uniformly; then crop, flips, gain and gamma.
///
/// A function of (manifest seed, place, attempt) and nothing else, so that a training resumes with
/// the number of the step alone. `attempt` draws the frames and the rest again, but never the
/// recording. Thread safe.
SampleDraw draw_sample(std::span<const TrainingRecording> recordings,
                       const TrainingManifest& manifest, const SamplePlace& place, int attempt);

}  // namespace eventgan
