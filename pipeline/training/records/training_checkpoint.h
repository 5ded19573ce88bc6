#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "manifests/state_dict.h"
#include "pipeline/training/training_position.h"

namespace eventgan {

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
