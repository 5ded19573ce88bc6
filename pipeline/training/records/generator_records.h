#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>

#include "manifests/state_dict.h"
#include "manifests/training_manifest.h"
#include "pipeline/training/records/validation.h"
#include "pipeline/training/samples/training_recording.h"
#include "pipeline/training/training_folder.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// What a training writes about its generator: weights, validation scores, pictures. Each takes
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

  /// The position's picture: of validation pairs, else of the batch.
  void draw(const StateDict& generator_state, const TrainingPosition& position,
            std::span<const TrainingSample> batch) const;

  /// weights.safetensors, with all that is known of its origin. Gives the file's SHA-256.
  std::string write_final_weights(const StateDict& generator_state,
                                  const TrainingPosition& position,
                                  std::span<const TrainingRecording> recordings,
                                  const std::map<std::string, double>& losses) const;

 private:
  const TrainingManifest& manifest_;
  TrainingFolder folder_;
  std::optional<ValidationPairs> validation_pairs_;
  std::optional<ValidationLog> validation_log_;
};

}  // namespace eventgan
