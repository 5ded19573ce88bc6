#include "pipeline/training/records/training_settings.h"

#include <ATen/Parallel.h>
#include <torch/version.h>

#include "manifests/faults.h"
#include "manifests/manifest_fields.h"
#include "manifests/plan.h"
#include "pipeline/planning/fingerprint.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Bytes of a file, or of all files of a folder.
std::uintmax_t bytes_of(const fs::path& path) {
  if (!fs::is_directory(path)) return fs::file_size(path);
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) bytes += entry.file_size();
  }
  return bytes;
}

std::string description(const TrainingRecording& opened) {
  const ImageSize size = opened.recording->size();
  std::error_code absent;
  const bool there = fs::exists(opened.file, absent);
  return std::to_string(there ? bytes_of(opened.file) : 0) + " bytes, " +
         std::to_string(opened.recording->frame_count()) + " frames of " +
         std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace

std::map<std::string, std::string> training_settings(
    const TrainingManifest& manifest, std::span<const TrainingRecording> recordings) {
  std::map<std::string, std::string> settings;
  for (const auto& [field, value] : manifest_fields(manifest.text)) {
    if (!field.starts_with("$.output.")) settings["manifest " + field] = value;
  }
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    settings["recording " + std::to_string(i)] = description(recordings[i]);
  }
  return settings;
}

std::map<std::string, std::string> training_environment(const std::string& device) {
  return {{"threads", std::to_string(at::get_num_threads())},
          {"device", device},
          {"cpu", instruction_sets()},
          {"libtorch", TORCH_VERSION},
          {"program", program_version()}};
}

void check_resumable(std::map<std::string, std::string> before,
                     std::map<std::string, std::string> now, const TrainingPosition& position,
                     const TrainingManifest& manifest) {
  for (const auto phase :
       {TrainingPhase::kFlow, TrainingPhase::kReconstruction, TrainingPhase::kGenerator}) {
    const std::int64_t steps = steps_of(manifest.steps, phase);
    const bool in_progress = phase == position.phase && steps >= position.step &&
                             manifest.optimizer.final_rate_fraction == 1;
    if (phase > position.phase || in_progress) {
      const std::string field = "manifest $.steps." + std::string(to_string(phase));
      before.erase(field);
      now.erase(field);
    }
  }
  const auto differences = fingerprint_differences(before, now);
  if (differences.empty()) return;
  std::string message =
      "the training in the output folder began with other settings (--overwrite starts again):";
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

}  // namespace eventgan
