#include "pipeline/training/samples/sample_draw.h"

#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/counter_random.h"

namespace eventgan {
namespace {

/// Counters of one attempt's draws.
enum SampleCounter : std::uint64_t { kStatic, kGap, kFirstFrame };

std::size_t by_weight(std::span<const TrainingRecording> recordings, double uniform) {
  double total = 0;
  for (const TrainingRecording& recording : recordings) total += recording.weight;
  double left = uniform * total;
  for (std::size_t i = 0; i + 1 < recordings.size(); ++i) {
    left -= recordings[i].weight;
    if (left < 0) return i;
  }
  return recordings.size() - 1;
}

}  // namespace

SampleDraw draw_sample(std::span<const TrainingRecording> recordings,
                       const TrainingManifest& manifest, const SamplePlace& place, int attempt) {
  if (recordings.empty())
    throw std::invalid_argument("expected a recording to draw from, got none");
  const CounterRandom sample = CounterRandom(manifest.seed)
                                   .keyed("sample")
                                   .keyed(to_string(place.phase))
                                   .keyed(std::to_string(place.step))
                                   .keyed(std::to_string(place.index));
  const CounterRandom random = sample.keyed("attempt " + std::to_string(attempt));
  SampleDraw draw;
  draw.recording = by_weight(recordings, sample.keyed("recording").uniform(0));
  const TrainingRecording& recording = recordings[draw.recording];
  const std::int64_t span = recording.last_frame - recording.first_frame;

  std::int64_t gap = 0;
  if (random.uniform(kStatic) >= manifest.augmentation.static_fraction) {
    std::vector<int> fitting;
    for (const int each : manifest.gaps) {
      if (each <= span) fitting.push_back(each);
    }
    if (fitting.empty()) throw std::invalid_argument("expected a gap that fits, got none");
    gap = fitting[random.below(kGap, fitting.size())];
  }
  draw.first_frame =
      recording.first_frame + static_cast<std::int64_t>(random.below(
                                  kFirstFrame, static_cast<std::uint64_t>(span - gap + 1)));
  draw.last_frame = draw.first_frame + gap;
  draw.augmentation = draw_augmentation(recording.recording->size(), manifest.crop,
                                        manifest.augmentation, random.keyed("augmentation"));
  return draw;
}

}  // namespace eventgan
