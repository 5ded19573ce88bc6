#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"
#include "manifests/values/training.h"
#include "pipeline/training/training_recording.h"
#include "stages/generator/generator.h"
#include "stages/training/training_sample.h"

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
  /// The crop is to hold this event of the pair's, by its share of them all, 0..1 without 1.
  std::optional<double> event;
  Augmentation augmentation;
};

/// Draws a sample: recording by weight; then, with probability static_fraction, one frame twice;
/// else the gap uniformly from those of the manifest that fit the recording's part in use, and the
/// first frame uniformly; then crop, flips, reversal, gain and gamma; and with probability
/// event_fraction an event.
///
/// A function of (manifest seed, place, attempt) and nothing else, so that a training resumes with
/// the number of the step alone. `attempt` draws the frames and the rest again, but never the
/// recording. Thread safe.
SampleDraw draw_sample(std::span<const TrainingRecording> recordings,
                       const TrainingManifest& manifest, const SamplePlace& place, int attempt);

/// A few hundred images hold more than a training sees; they stay in memory.
inline constexpr std::size_t kMostTextures = 256;

/// The images in the folders and their subfolders, in the order of their paths: at most `most`,
/// evenly spread. What trainings have drawn into their output folders is none. Throws InputError if
/// a folder cannot be listed.
std::vector<std::filesystem::path> texture_files(std::span<const std::filesystem::path> folders,
                                                 std::size_t most = kMostTextures);

/// These images, grey. Throws InputError if there is none, or one cannot be read.
std::vector<GreyImage> read_textures(std::span<const std::filesystem::path> folders,
                                     std::size_t most = kMostTextures);

/// The folders of the manifest's `simulated.textures`, in its order.
std::vector<std::filesystem::path> texture_folders(const TrainingManifest& manifest);

/// The network of the manifest's `teacher`, which is there, in float32. Throws InputError if the
/// weights cannot be used; UsageError if they have not learnt a sensor's threshold, all of those of
/// this training, or its bins.
std::unique_ptr<Generator> open_teacher(const TrainingManifest& manifest);

/// The samples of a training: each a function of the manifest and its place, whatever was asked for
/// before. Thread safe.
class SampleSource {
 public:
  /// `recordings` of the manifest, opened. Reads the textures of simulated scenes, and the teacher;
  /// throws as read_textures and open_teacher, and InputError where a recording has no event
  /// between the frames in use.
  SampleSource(const TrainingManifest& manifest, std::vector<TrainingRecording> recordings);

  /// With probability simulated.fraction a simulated one (simulate_planes), without augmentation;
  /// else the sample drawn by draw_sample. As in the published code a pair whose first interval has
  /// fewer than 100 events in the whole image is drawn again (at most 9 times, from the same
  /// recording): η98 would blow its noise up to full scale. With the teacher's rates in the phase
  /// of the generator. Throws InputError naming the recording if it cannot be read.
  TrainingSample sample(const SamplePlace& place) const;

  /// The samples of a step, manifest.batch of them.
  std::vector<TrainingSample> batch(TrainingPhase phase, std::int64_t step) const;

  const std::vector<TrainingRecording>& recordings() const { return reader_.recordings(); }

 private:
  TrainingSample recorded_sample(const SamplePlace& place) const;
  TrainingSample simulated_sample(const SamplePlace& place, const CounterRandom& random) const;

  TrainingManifest manifest_;
  CropReader reader_;
  std::vector<GreyImage> textures_;
  std::unique_ptr<Generator> teacher_;
};

/// Prepares the batches of the steps to come in the background, a few ahead and no more. Since a
/// batch is a function of its step, what it gives does not depend on timing. For one thread; `make`
/// is called from several at once.
class BatchPrefetch {
 public:
  using Batch = std::vector<TrainingSample>;

  /// Batches of the steps first..end-1, at most `ahead` ≥ 1 of them in preparation or waiting.
  BatchPrefetch(std::function<Batch(std::int64_t)> make, std::int64_t first, std::int64_t end,
                int ahead);

  /// The next step's batch; rethrows what `make` threw for it. Throws std::out_of_range after the
  /// last one.
  Batch next();

 private:
  void fill();

  std::function<Batch(std::int64_t)> make_;
  std::int64_t started_;
  std::int64_t end_;
  std::size_t ahead_;
  std::deque<std::future<Batch>> waiting_;  // destroyed first, and so waits for the calls of make_
};

}  // namespace eventgan
