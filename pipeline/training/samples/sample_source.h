#pragma once

#include <cstdint>
#include <vector>

#include "manifests/training_manifest.h"
#include "pipeline/training/samples/crop_reader.h"
#include "pipeline/training/samples/sample_draw.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// The samples of a training: each a function of the manifest and its place, whatever was asked for
/// before. Thread safe.
class SampleSource {
 public:
  /// `recordings` of the manifest, opened.
  SampleSource(const TrainingManifest& manifest, std::vector<TrainingRecording> recordings);

  /// The sample drawn by draw_sample. As in the published code a pair whose first interval has
  /// fewer than 100 events in the whole picture is drawn again (at most 10 times, from the same
  /// recording): η98 would blow its noise up to full scale. Throws InputError naming the recording
  /// if it cannot be read.
  TrainingSample sample(const SamplePlace& place) const;

  /// The samples of a step, manifest.batch of them.
  std::vector<TrainingSample> batch(TrainingPhase phase, std::int64_t step) const;

  const std::vector<TrainingRecording>& recordings() const { return reader_.recordings(); }

 private:
  TrainingManifest manifest_;
  CropReader reader_;
};

}  // namespace eventgan
