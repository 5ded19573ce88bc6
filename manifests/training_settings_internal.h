#pragma once

#include "manifests/strict_json/strict_json_internal.h"
#include "manifests/training_manifest.h"

namespace eventgan {

// Reads the sections of a training manifest.

RecordingSpec read_recording(const StrictValue& value);
NetworkSpec read_network(const StrictValue& value);
LossWeights read_losses(const StrictValue& value);
AugmentationSpec read_augmentation(const StrictValue& value);
OptimizerSpec read_optimizer(const StrictValue& value);
PhaseSteps read_steps(const StrictValue& value);

}  // namespace eventgan
