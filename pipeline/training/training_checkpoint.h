#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "manifests/values/training.h"
#include "manifests/values/weights.h"
#include "pipeline/training/training_recording.h"

namespace eventgan {

/// Number of steps of a phase.
inline std::int64_t steps_of(const PhaseSteps& steps, TrainingPhase phase) {
  return phase == TrainingPhase::kFlow             ? steps.flow
         : phase == TrainingPhase::kReconstruction ? steps.reconstruction
                                                   : steps.generator;
}

/// What decides a training's result, field by field: the manifest's settings (without comments and
/// `output`), and the SHA-256 of each recording with what lies beside it, of the textures that are
/// used of each folder, and of the teacher: "recording 0", "textures 0", "teacher". Reads all of
/// them.
std::map<std::string, std::string> training_settings(const TrainingManifest& manifest,
                                                     std::span<const TrainingRecording> recordings);

/// What may change the last bits of a result, and no more: threads, device, processor,
/// LibTorch, program.
std::map<std::string, std::string> training_environment(const std::string& device);

/// Throws UsageError if the settings are those of two trainings: another name, or other recordings.
void check_same_training(const std::map<std::string, std::string>& before,
                         const std::map<std::string, std::string>& now);

/// Throws UsageError listing the fields that differ, unless a training that began with `before` may
/// go on with `now` from `position`. Free to change are the steps of phases that are not reached
/// yet, and of the one in progress if its learning rates are constant: nothing done so far depends
/// on them.
void check_resumable(std::map<std::string, std::string> before,
                     std::map<std::string, std::string> now, const TrainingPosition& position,
                     const TrainingManifest& manifest);

/// Everything a training goes on from.
struct TrainingCheckpoint {
  TrainingPosition position;
  double seconds = 0;                              ///< trained so far, all runs together
  std::map<std::string, std::string> settings;     ///< training_settings()
  std::map<std::string, std::string> environment;  ///< what may change the last bits only
  StateDict state;                                 ///< Trainer::state()
};

/// Saves it as FOLDER/latest.safetensors; the one before becomes previous.safetensors. At every
/// moment, also after a kill or a power cut, one of the two is whole. The file holds a SHA-256 of
/// all that is in it. Throws std::runtime_error
/// naming the file, or the tensor with a number that is not finite: such a state is of no use, and
/// must not push out a good one.
void save_checkpoint(const std::filesystem::path& folder, TrainingCheckpoint checkpoint);

/// The latest checkpoint of the folder; the previous one, with a warning, if the latest cannot be
/// read or is not what was saved, which then becomes damaged.safetensors; nothing if there is none.
/// Throws std::runtime_error, the causes nested, if there are some
/// and none can be read.
std::optional<TrainingCheckpoint> load_checkpoint(
    const std::filesystem::path& folder, const std::function<void(const std::string&)>& warn);

/// The path of the last good checkpoint, for messages; empty if there is none.
std::filesystem::path last_checkpoint(const std::filesystem::path& folder);

}  // namespace eventgan
