#pragma once

#include <map>
#include <span>
#include <string>

#include "manifests/training_manifest.h"
#include "pipeline/training/samples/training_recording.h"
#include "pipeline/training/training_position.h"

namespace eventgan {

/// What decides a training's result, field by field: the manifest's settings (without comments and
/// `output`), and the size in bytes, pictures and frames of each recording and of what lies beside
/// it.
std::map<std::string, std::string> training_settings(const TrainingManifest& manifest,
                                                     std::span<const TrainingRecording> recordings);

/// What may change the last bits of a result, and no more: threads, device, processor,
/// LibTorch, program.
std::map<std::string, std::string> training_environment(const std::string& device);

/// Throws UsageError listing the fields that differ, unless a training that began with `before` may
/// go on with `now` from `position`. Free to change are the steps of phases that are not reached
/// yet, and of the one in progress if its learning rates are constant: nothing done so far depends
/// on them.
void check_resumable(std::map<std::string, std::string> before,
                     std::map<std::string, std::string> now, const TrainingPosition& position,
                     const TrainingManifest& manifest);

}  // namespace eventgan
