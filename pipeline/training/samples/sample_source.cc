#include "pipeline/training/samples/sample_source.h"

#include <utility>

namespace eventgan {
namespace {

constexpr std::size_t kFewestEvents = 100;
constexpr int kMostAttempts = 10;

}  // namespace

SampleSource::SampleSource(const TrainingManifest& manifest,
                           std::vector<TrainingRecording> recordings)
    : manifest_(manifest), reader_(std::move(recordings), manifest.network.bins) {}

TrainingSample SampleSource::sample(const SamplePlace& place) const {
  const auto draw_again = [&](const SampleDraw& draw) {
    return draw.first_frame != draw.last_frame &&
           reader_.event_count(draw.recording, draw.first_frame) < kFewestEvents;
  };
  SampleDraw draw = draw_sample(recordings(), manifest_, place, 0);
  for (int attempt = 1; attempt < kMostAttempts && draw_again(draw); ++attempt) {
    draw = draw_sample(recordings(), manifest_, place, attempt);
  }
  Augmentation augmentation = draw.augmentation;
  const CropBox box{augmentation.top, augmentation.left, augmentation.crop};
  const TrainingSample cut = reader_.read(draw.recording, draw.first_frame, draw.last_frame, box);
  augmentation.top = augmentation.left = 0;  // it is cut already
  TrainingSample sample = augment(cut, augmentation);
  sample.origin = cut.origin;  // augment has added where it cut: nothing of the picture
  return sample;
}

std::vector<TrainingSample> SampleSource::batch(TrainingPhase phase, std::int64_t step) const {
  std::vector<TrainingSample> samples;
  for (int i = 0; i < manifest_.batch; ++i) samples.push_back(sample({phase, step, i}));
  return samples;
}

}  // namespace eventgan
