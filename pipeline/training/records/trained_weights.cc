#include "pipeline/training/records/trained_weights.h"

#include <algorithm>
#include <vector>

#include "pipeline/planning/fingerprint.h"
#include "pipeline/training/records/csv_table.h"
#include "stages/files/sha256.h"
#include "stages/generator/checkpoints/fold.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Of a recording in a folder: of the lists of frames and events, which say what it holds.
std::string recording_hash(const fs::path& path) {
  if (!fs::is_directory(path)) return sha256_of_file(path);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::string listing;
  for (const fs::path& file : files) {
    listing += file.filename().string() + '\t' + sha256_of_file(file) + '\n';
  }
  return sha256_hex(listing);
}

std::string steps_text(const TrainingManifest& manifest, const TrainingPosition& position) {
  std::string text;
  for (const auto phase :
       {TrainingPhase::kFlow, TrainingPhase::kReconstruction, TrainingPhase::kGenerator}) {
    const std::int64_t steps = phase < position.phase    ? steps_of(manifest.steps, phase)
                               : phase == position.phase ? position.step
                                                         : 0;
    text +=
        (text.empty() ? "" : ", ") + std::string(to_string(phase)) + ' ' + std::to_string(steps);
  }
  return text;
}

}  // namespace

Weights trained_weights(const StateDict& generator_state, const TrainingManifest& manifest,
                        const TrainingPosition& position) {
  Weights weights = fold_generator(generator_state, "the trained generator");
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
                      std::span<const TrainingRecording> recordings,
                      const std::map<std::string, double>& losses) {
  std::string listing;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    listing += manifest.recordings.at(i).path + '\t' + recording_hash(recordings[i].file) + '\n';
  }
  weights.metadata["training_recordings_sha256"] = listing;
  std::string means;
  for (const auto& [name, value] : losses) means += name + '\t' + csv_number(value) + '\n';
  weights.metadata["training_losses"] = means;
}

}  // namespace eventgan
