#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/training.h"
#include "manifests/values/weights.h"
#include "pipeline/training/csv_table.h"
#include "pipeline/training/training_checkpoint.h"
#include "pipeline/training/training_folder.h"
#include "pipeline/training/training_recording.h"
#include "stages/events/realism/realism_scores.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// The thresholds that a network which knows its sensor is told in this training: those of the
/// recordings, of both polarities, and the means of those that simulated scenes are drawn with;
/// with gamma each is told as the threshold of more or less contrast. None for another network.
std::optional<ThresholdRange> trained_thresholds(const TrainingManifest& manifest);

/// The trained generator, folded, ready to run. Its metadata say where it comes from: the
/// manifest's text and SHA-256, the steps made, and the program's version. Throws
/// std::runtime_error if the state is not a generator's.
Weights trained_weights(const StateDict& generator_state, const TrainingManifest& manifest,
                        const TrainingPosition& position);

/// Adds what is known at the end: the path of each recording and folder of textures as the manifest
/// has it, with the SHA-256 that training_settings found when the training began or resumed, the
/// teacher's, and the losses, means over the last steps.
void add_final_origin(Weights& weights, const TrainingManifest& manifest,
                      const std::map<std::string, std::string>& settings,
                      const std::map<std::string, double>& losses);

/// Means over the validation pairs.
struct ValidationScores {
  double volume_loss = 0;  ///< mean |generated - real| of what the network gives
  RealismScores realism;
};

/// Fixed pairs to judge a generator by in the course of a training: consecutive frames of the
/// validation recordings, the middle of the image, at most 16, evenly spread where there are
/// more. Read once and kept.
class ValidationPairs {
 public:
  /// `crop`: the training's; recordings with smaller images are taken whole. Throws InputError if
  /// a recording cannot be read.
  ValidationPairs(const CropReader& reader, ImageSize crop);

  const std::vector<TrainingSample>& samples() const { return samples_; }

  ValidationScores judge(const Generator& generator) const;

 private:
  std::vector<TrainingSample> samples_;
};

/// What the generator makes of a sample: [2 bins, y, x].
std::vector<float> generated_volume(const Generator& generator, const TrainingSample& sample);

/// validation.csv: a row a checkpoint; columns step, volume_loss and realism's scores.
class ValidationLog {
 public:
  /// Resumes FILE; rows of checkpoints after `step` are cut off.
  ValidationLog(const std::filesystem::path& file, std::int64_t step);

  void add(std::int64_t step, const ValidationScores& scores);

 private:
  CsvTable table_;
};

/// What a training writes about its generator: weights, validation scores, images. Each takes
/// Trainer::generator_state(). save() and draw() may leave LibTorch with another number of threads.
/// Throw std::runtime_error naming the file. Not thread safe.
class GeneratorRecords {
 public:
  /// Reads the validation pairs, if the manifest has any; throws InputError and UsageError about
  /// their recordings. Writes nothing yet.
  GeneratorRecords(const TrainingManifest& manifest, const TrainingFolder& folder);

  /// Opens validation.csv and cuts off what came after the position. To be called before save().
  void go_on_from(const TrainingPosition& position);

  /// weights-latest.safetensors, and a row of validation.csv.
  void save(const StateDict& generator_state, const TrainingPosition& position);

  /// The position's image: of validation pairs, else of the batch.
  void draw(const StateDict& generator_state, const TrainingPosition& position,
            std::span<const TrainingSample> batch) const;

  /// weights.safetensors, with all that is known of its origin. Gives the file's SHA-256.
  std::string write_final_weights(const StateDict& generator_state,
                                  const TrainingPosition& position,
                                  const std::map<std::string, std::string>& settings,
                                  const std::map<std::string, double>& losses) const;

 private:
  const TrainingManifest& manifest_;
  TrainingFolder folder_;
  std::optional<ValidationPairs> validation_pairs_;
  std::optional<ValidationLog> validation_log_;
};

}  // namespace eventgan
