#pragma once

#include <map>
#include <span>
#include <string>

#include "manifests/state_dict.h"
#include "manifests/training_manifest.h"
#include "pipeline/training/samples/training_recording.h"
#include "pipeline/training/training_position.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The trained generator, folded, ready to run. Its metadata say where it comes from: the
/// manifest's text and SHA-256, the steps made, and the program's version. Throws
/// std::runtime_error if the state is not a generator's.
Weights trained_weights(const StateDict& generator_state, const TrainingManifest& manifest,
                        const TrainingPosition& position);

/// Adds what is known at the end: each recording's path as the manifest has it with the SHA-256 of
/// its files (reads them whole), and the losses, means over the last steps.
void add_final_origin(Weights& weights, const TrainingManifest& manifest,
                      std::span<const TrainingRecording> recordings,
                      const std::map<std::string, double>& losses);

}  // namespace eventgan
