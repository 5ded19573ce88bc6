#include "pipeline/training/sample_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/planning/spread.h"
#include "pipeline/training/generator_records.h"
#include "pipeline/training/training_folder.h"
#include "stages/base/images/image_file.h"
#include "stages/events/event_volume.h"
#include "stages/events/simulation/moving_planes.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/generator/weights_file.h"

namespace eventgan {
namespace {

/// Counters of one attempt's draws.
enum SampleCounter : std::uint64_t { kStatic, kGap, kFirstFrame, kAtEvent, kEvent };

CounterRandom sample_random(const TrainingManifest& manifest, const SamplePlace& place) {
  return CounterRandom(manifest.seed)
      .keyed("sample")
      .keyed(to_string(place.phase))
      .keyed(std::to_string(place.step))
      .keyed(std::to_string(place.index));
}

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
  const CounterRandom sample = sample_random(manifest, place);
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
  if (random.uniform(kAtEvent) < manifest.augmentation.event_fraction) {
    draw.event = random.uniform(kEvent);
  }
  return draw;
}

namespace {

constexpr std::size_t kFewestEvents = 100;
constexpr int kMostAttempts = 10;

/// Where a crop of `cut` pixels that was drawn to begin at `drawn`, uniformly over `image`
/// pixels, begins if it is to hold pixel `at`: uniformly over the places where it does.
int holding(int drawn, int at, int cut, int image) {
  if (image == cut) return drawn;
  const int first = std::max(0, at - cut + 1);
  const int last = std::min(at, image - cut);
  return first + static_cast<int>(std::int64_t{drawn} * (last - first + 1) / (image - cut + 1));
}

}  // namespace

std::vector<std::filesystem::path> texture_files(std::span<const std::filesystem::path> folders,
                                                 std::size_t most) {
  namespace fs = std::filesystem;
  const auto is_image = [](const fs::path& file) {
    return std::ranges::find(kImageExtensions, lower_extension(file)) != kImageExtensions.end();
  };
  std::vector<fs::path> files;
  for (const fs::path& folder : folders) {
    try {
      for (auto at = fs::recursive_directory_iterator(folder); at != fs::end(at); ++at) {
        if (at->is_directory() && fs::exists(TrainingFolder{at->path()}.lock())) {
          at.disable_recursion_pending();
        } else if (at->is_regular_file() && is_image(at->path())) {
          files.push_back(at->path());
        }
      }
    } catch (const fs::filesystem_error&) {
      std::throw_with_nested(InputError("cannot list the textures in " + folder.string()));
    }
  }
  std::ranges::sort(files);
  std::vector<fs::path> chosen;
  for (const std::size_t place : spread(most, files.size())) chosen.push_back(files[place]);
  return chosen;
}

std::vector<GreyImage> read_textures(std::span<const std::filesystem::path> folders,
                                     std::size_t most) {
  const std::vector<std::filesystem::path> files = texture_files(folders, most);
  if (files.empty()) {
    throw InputError("expected images for simulated.textures, got none, in " +
                     (folders.empty() ? "no folder" : folders.front().string()));
  }
  std::vector<GreyImage> textures;
  for (const std::filesystem::path& file : files) {
    try {
      const ColourFrame image = decode_image_file(file);
      textures.push_back(
          {image.size, prepare_frame(ColourView{image.size, image.bgr.data()}, {}).grey});
    } catch (const std::runtime_error&) {
      std::throw_with_nested(InputError("cannot use the texture " + file.string()));
    }
  }
  return textures;
}

std::vector<std::filesystem::path> texture_folders(const TrainingManifest& manifest) {
  std::vector<std::filesystem::path> folders;
  if (!manifest.simulated) return folders;
  for (const std::string& folder : manifest.simulated->textures) {
    folders.push_back(resolve(manifest, folder));
  }
  return folders;
}

std::unique_ptr<Generator> open_teacher(const TrainingManifest& manifest) {
  const std::filesystem::path file = resolve(manifest, manifest.teacher.value());
  const Weights weights = read_weights(file);
  const ThresholdRange wanted = trained_thresholds(manifest).value();
  const auto fault = [&](const std::string& expected, const std::string& got) {
    return UsageError(
        fmt::format("$.teacher: expected {}, got {}, in {}", expected, got, file.string()));
  };
  const auto text = [](const ThresholdRange& range) {
    return fmt::format("{:.3g}..{:.3g}", range.lowest, range.highest);
  };
  if (weights.bins != manifest.network.bins) {
    throw fault(fmt::format("{} bins as in network.bins", manifest.network.bins),
                std::to_string(weights.bins));
  }
  const auto& learnt = weights.thresholds;
  if (!learnt || learnt->lowest > wanted.lowest || learnt->highest < wanted.highest) {
    throw fault("weights that have learnt the thresholds of this training, " + text(wanted),
                learnt ? text(*learnt) : "ones that have learnt none");
  }
  return make_fastest_generator(weights);
}

SampleSource::SampleSource(const TrainingManifest& manifest,
                           std::vector<TrainingRecording> recordings)
    : manifest_(manifest), reader_(std::move(recordings), manifest.network.bins) {
  if (manifest.simulated) {
    textures_ = read_textures(texture_folders(manifest));
  }
  if (manifest.teacher) teacher_ = open_teacher(manifest);
  for (std::size_t i = 0; i < this->recordings().size(); ++i) {
    const TrainingRecording& part = this->recordings()[i];
    std::int64_t frame = part.first_frame;
    while (frame < part.last_frame && reader_.event_count(i, frame) == 0) ++frame;
    if (frame < part.last_frame) continue;
    throw InputError(
        "expected events between the frames to train on, got none (are events and frames on one "
        "clock?), in " +
        part.file.string());
  }
}

TrainingSample SampleSource::simulated_sample(const SamplePlace& place,
                                              const CounterRandom& random) const {
  const SimulatedPair pair = simulate_planes(textures_, manifest_.crop, random);
  TrainingSample sample;
  sample.shape = {manifest_.network.bins, manifest_.crop};
  const std::size_t pixels = manifest_.crop.pixel_count();
  sample.frames.resize(2 * pixels);
  to_input(pair.previous.pixels, std::span(sample.frames).first(pixels));
  to_input(pair.next.pixels, std::span(sample.frames).last(pixels));
  sample.volume = event_volume(pair.events, sample.shape, std::array{0.0, pair.duration_s});
  sample.threshold = pair.threshold;
  sample.origin =
      "simulated sample " + std::to_string(place.index) + " of step " + std::to_string(place.step);
  sample.network_frames = sample.frames;
  return sample;
}

TrainingSample SampleSource::recorded_sample(const SamplePlace& place) const {
  const auto draw_again = [&](const SampleDraw& draw) {
    return draw.first_frame != draw.last_frame &&
           reader_.event_count(draw.recording, draw.first_frame) < kFewestEvents;
  };
  SampleDraw draw = draw_sample(recordings(), manifest_, place, 0);
  for (int attempt = 1; attempt < kMostAttempts && draw_again(draw); ++attempt) {
    draw = draw_sample(recordings(), manifest_, place, attempt);
  }
  Augmentation augmentation = draw.augmentation;
  if (draw.event && draw.first_frame != draw.last_frame) {
    const auto event =
        reader_.event(draw.recording, draw.first_frame, draw.last_frame, *draw.event);
    const ImageSize size = recordings()[draw.recording].recording->size();
    if (event) {
      augmentation.top = holding(augmentation.top, event->y, augmentation.crop.height, size.height);
      augmentation.left = holding(augmentation.left, event->x, augmentation.crop.width, size.width);
    }
  }
  const CropBox box{augmentation.top, augmentation.left, augmentation.crop};
  const TrainingSample cut = reader_.read(draw.recording, draw.first_frame, draw.last_frame, box);
  augmentation.top = augmentation.left = 0;  // it is cut already
  TrainingSample sample = augment(cut, augmentation);
  sample.origin = cut.origin;  // augment has added where it cut: nothing of the image
  return sample;
}

TrainingSample SampleSource::sample(const SamplePlace& place) const {
  const CounterRandom random = sample_random(manifest_, place).keyed("simulated");
  TrainingSample sample = manifest_.simulated && random.uniform(0) < manifest_.simulated->fraction
                              ? simulated_sample(place, random)
                              : recorded_sample(place);
  if (teacher_ && place.phase == TrainingPhase::kGenerator) {
    sample.taught_rates = generated_volume(*teacher_, sample);
  }
  return sample;
}

std::vector<TrainingSample> SampleSource::batch(TrainingPhase phase, std::int64_t step) const {
  std::vector<TrainingSample> samples;
  for (int i = 0; i < manifest_.batch; ++i) samples.push_back(sample({phase, step, i}));
  return samples;
}

BatchPrefetch::BatchPrefetch(std::function<Batch(std::int64_t)> make, std::int64_t first,
                             std::int64_t end, int ahead)
    : make_(std::move(make)), started_(first), end_(end), ahead_(static_cast<std::size_t>(ahead)) {
  fill();
}

BatchPrefetch::Batch BatchPrefetch::next() {
  if (waiting_.empty()) throw std::out_of_range("expected a step before the last, got none left");
  std::future<Batch> oldest = std::move(waiting_.front());
  waiting_.pop_front();
  Batch batch = oldest.get();
  fill();
  return batch;
}

void BatchPrefetch::fill() {
  while (waiting_.size() < ahead_ && started_ < end_) {
    // A thread of its own: the caller computes a step meanwhile.
    waiting_.push_back(std::async(std::launch::async, make_, started_++));
  }
}

}  // namespace eventgan
