#include "pipeline/training/records/generator_records.h"

#include <future>

#include "pipeline/training/records/generator_picture.h"
#include "pipeline/training/records/trained_weights.h"
#include "stages/files/atomic_file.h"
#include "stages/files/sha256.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_files/weights_file.h"

namespace eventgan {
namespace {

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
    write_generator_picture(*make_torch_generator(weights),
                            validation_pairs_ ? std::span(validation_pairs_->samples()) : batch,
                            folder_.picture(position));
  });
}

std::string GeneratorRecords::write_final_weights(
    const StateDict& generator_state, const TrainingPosition& position,
    std::span<const TrainingRecording> recordings,
    const std::map<std::string, double>& losses) const {
  Weights weights = trained_weights(generator_state, manifest_, position);
  add_final_origin(weights, manifest_, recordings, losses);
  const std::string bytes = serialize_weights(weights);
  write_file_atomically(folder_.weights(), bytes);
  return sha256_hex(bytes);
}

}  // namespace eventgan
