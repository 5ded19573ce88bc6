#include "pipeline/training/generator_records.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <future>
#include <limits>
#include <numeric>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "manifests/files/atomic_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/words.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/planning/spread.h"
#include "pipeline/training/csv_table.h"
#include "stages/events/images/comparison_image.h"
#include "stages/events/simulation/moving_planes.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/generator.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_file.h"
#include "stages/recordings/readers/recording.h"
#include "stages/training/training_sample.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

std::string steps_text(const TrainingManifest& manifest, const TrainingPosition& position) {
  std::vector<std::string> parts;
  for (const auto& [word, phase] : kPhaseWords) {
    const std::int64_t steps = phase < position.phase    ? steps_of(manifest.steps, phase)
                               : phase == position.phase ? position.step
                                                         : 0;
    parts.push_back(fmt::format("{} {}", word, steps));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace

std::optional<ThresholdRange> trained_thresholds(const TrainingManifest& manifest) {
  if (!manifest.network.sensor) return std::nullopt;
  ThresholdRange range{std::numeric_limits<double>::max(), 0};
  for (const auto& recording : manifest.recordings) {
    const ContrastThreshold& threshold = *recording.threshold;
    const auto [low, high] = std::minmax({threshold.positive(), threshold.negative()});
    range.lowest = std::min(range.lowest, low * manifest.augmentation.gamma[0]);
    range.highest = std::max(range.highest, high * manifest.augmentation.gamma[1]);
  }
  if (manifest.simulated) {
    range.lowest = std::min(range.lowest, kPlaneThresholds.lowest);
    range.highest = std::max(range.highest, kPlaneThresholds.highest);
  }
  return range;
}

Weights trained_weights(const StateDict& generator_state, const TrainingManifest& manifest,
                        const TrainingPosition& position) {
  Weights weights =
      fold_generator(generator_state, "the trained generator", trained_thresholds(manifest));
  const auto [first, last] = std::ranges::minmax(manifest.gaps);
  weights.training_gaps = GapRange{first, last};
  weights.metadata["origin"] = "eventgan train";
  weights.metadata["program"] = program_version();
  weights.metadata["training_manifest"] = manifest.text;
  weights.metadata["training_manifest_sha256"] = sha256_hex(manifest.text);
  weights.metadata["training_steps"] = steps_text(manifest, position);
  return weights;
}

void add_final_origin(Weights& weights, const TrainingManifest& manifest,
                      const std::map<std::string, std::string>& settings,
                      const std::map<std::string, double>& losses) {
  const auto listing = [&](const std::string& kind, std::size_t count, const auto& path_of) {
    std::string lines;
    for (std::size_t i = 0; i < count; ++i) {
      lines += path_of(i) + '\t' + settings.at(fmt::format("{} {}", kind, i)) + '\n';
    }
    return lines;
  };
  weights.metadata["training_recordings_sha256"] =
      listing("recording", manifest.recordings.size(),
              [&](std::size_t i) { return manifest.recordings[i].path; });
  if (manifest.simulated) {
    const std::vector<std::string>& folders = manifest.simulated->textures;
    weights.metadata["training_textures_sha256"] =
        listing("textures", folders.size(), [&](std::size_t i) { return folders[i]; });
  }
  if (manifest.teacher) weights.metadata["training_teacher_sha256"] = settings.at("teacher");
  std::string means;
  for (const auto& [name, value] : losses) means += name + '\t' + csv_number(value) + '\n';
  weights.metadata["training_losses"] = means;
}

namespace {

constexpr std::size_t kMostPairs = 16;

/// A frame of a [frame, y, x] float image in [-1, 1], as it was recorded.
GreyImage grey_frame(const TrainingSample& sample, std::size_t frame) {
  const std::size_t plane = sample.shape.size.pixel_count();
  GreyImage image{sample.shape.size, {}};
  for (std::size_t i = 0; i < plane; ++i) {
    const float value = (sample.frames[frame * plane + i] + 1) * 127.5f;
    image.pixels.push_back(static_cast<std::uint8_t>(std::lround(value)));
  }
  return image;
}

double mean_difference(const std::vector<float>& first, const std::vector<float>& second) {
  const double sum =
      std::transform_reduce(first.begin(), first.end(), second.begin(), 0.0, std::plus<>(),
                            [](double a, double b) { return std::abs(a - b); });
  return sum / static_cast<double>(std::max<std::size_t>(first.size(), 1));
}

CsvTable::Row validation_columns() {
  return {"step",
          "volume_loss",
          "f1_raw",
          "f1_time",
          "f1_time_polarity",
          "pool_mse_2",
          "pool_mse_4",
          "time_correlation",
          "polarity_correlation",
          "events_per_pixel",
          "positive_share"};
}

}  // namespace

std::vector<float> generated_volume(const Generator& generator, const TrainingSample& sample) {
  std::vector<float> volume(sample.shape.value_count());
  generator.generate({sample.network_frames, sample.shape.size, sample.threshold}, volume);
  return volume;
}

ValidationPairs::ValidationPairs(const CropReader& reader, ImageSize crop) {
  std::vector<std::pair<std::size_t, std::int64_t>> pairs;  // recording, first frame
  for (std::size_t i = 0; i < reader.recordings().size(); ++i) {
    const TrainingRecording& recording = reader.recordings()[i];
    for (std::int64_t frame = recording.first_frame; frame < recording.last_frame; ++frame) {
      pairs.emplace_back(i, frame);
    }
  }
  const std::size_t count = std::min(pairs.size(), kMostPairs);
  for (std::size_t k = 0; k < count; ++k) {
    const auto [recording, frame] = pairs[k * pairs.size() / count];
    const ImageSize size = reader.recordings()[recording].recording->size();
    samples_.push_back(reader.read(recording, frame, frame + 1, centre_crop(size, crop)));
  }
}

ValidationScores ValidationPairs::judge(const Generator& generator) const {
  ValidationScores result;
  std::vector<RealismScores> scores;
  for (const TrainingSample& sample : samples_) {
    std::vector<float> volume = generated_volume(generator, sample);
    result.volume_loss +=
        mean_difference(volume, sample.volume) / static_cast<double>(samples_.size());
    std::vector<float> real = sample.volume;
    if (sample.threshold) {  // rates and counts: each on its own scale
      volume = normalized(std::move(volume));
      real = normalized(std::move(real));
    }
    scores.push_back(
        realism_scores(volume, real, sample.shape, grey_frame(sample, 0), grey_frame(sample, 1)));
  }
  result.realism = mean_scores(scores);
  return result;
}

ValidationLog::ValidationLog(const std::filesystem::path& file, std::int64_t step)
    : table_(file, validation_columns(), [&](const CsvTable::Row& row) {
        return csv_value(row.front()) <= static_cast<double>(step);
      }) {}

void ValidationLog::add(std::int64_t step, const ValidationScores& scores) {
  CsvTable::Row row{std::to_string(step)};
  const RealismScores& realism = scores.realism;
  for (const double value :
       {scores.volume_loss, realism.f1_raw, realism.f1_time, realism.f1_time_polarity,
        realism.pool_mse_2, realism.pool_mse_4, realism.time_correlation,
        realism.polarity_correlation, realism.events_per_pixel, realism.positive_share}) {
    row.push_back(csv_number(value));
  }
  table_.add(row);
  table_.flush();
}

namespace {

constexpr std::size_t kMostRows = 4;

/// Draws what the generator makes of four of the samples, evenly spread (of all, if there are
/// fewer), beside the real volumes: see write_comparison_png, which says what is thrown.
void write_generator_image(const Generator& generator, std::span<const TrainingSample> samples,
                           const std::filesystem::path& file) {
  std::vector<ComparedPair> pairs;
  for (const std::size_t place : spread(kMostRows, samples.size())) {
    const TrainingSample& sample = samples[place];
    pairs.push_back({sample.shape,
                     sample.network_frames,
                     {{"real", sample.volume}, {"network", generated_volume(generator, sample)}},
                     sample.origin});
  }
  write_comparison_png(pairs, file);
}

/// The engine that runs weights keeps one LibTorch thread for the thread that calls it, for good;
/// the training's own must keep all of them.
template <class Work>
auto in_another_thread(const Work& work) {
  return std::async(std::launch::async, work).get();
}

}  // namespace

GeneratorRecords::GeneratorRecords(const TrainingManifest& manifest, const TrainingFolder& folder)
    : manifest_(manifest), folder_(folder) {
  if (manifest.validation.empty()) return;
  validation_pairs_.emplace(
      CropReader(open_training_recordings(manifest.validation, manifest.directory, {1, 1}, 1),
                 manifest.network.bins),
      manifest.crop);
}

void GeneratorRecords::go_on_from(const TrainingPosition& position) {
  if (!validation_pairs_) return;
  const bool begun = position.phase == TrainingPhase::kGenerator;
  validation_log_.emplace(folder_.validation(), begun ? position.step : -1);
}

void GeneratorRecords::save(const StateDict& generator_state, const TrainingPosition& position) {
  const Weights weights = trained_weights(generator_state, manifest_, position);
  write_file_atomically(folder_.latest_weights(), serialize_weights(weights));
  if (!validation_pairs_) return;
  validation_log_->add(position.step, in_another_thread([&] {
                         return validation_pairs_->judge(*make_torch_generator(weights));
                       }));
}

void GeneratorRecords::draw(const StateDict& generator_state, const TrainingPosition& position,
                            std::span<const TrainingSample> batch) const {
  const Weights weights = trained_weights(generator_state, manifest_, position);
  in_another_thread([&] {
    write_generator_image(*make_torch_generator(weights),
                          validation_pairs_ ? std::span(validation_pairs_->samples()) : batch,
                          folder_.image(position));
  });
}

std::string GeneratorRecords::write_final_weights(
    const StateDict& generator_state, const TrainingPosition& position,
    const std::map<std::string, std::string>& settings,
    const std::map<std::string, double>& losses) const {
  Weights weights = trained_weights(generator_state, manifest_, position);
  add_final_origin(weights, manifest_, settings, losses);
  const std::string bytes = serialize_weights(weights);
  write_file_atomically(folder_.weights(), bytes);
  return sha256_hex(bytes);
}

}  // namespace eventgan
