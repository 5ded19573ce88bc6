#pragma once

#include "manifests/training_manifest.h"

namespace eventgan {

/// Throws UsageError if the networks cannot be trained so: a single crop of up to 16x16, too little
/// for batch norm; a generator phase with no loss, or with the adversarial one and a crop smaller
/// than 48 pixels a side or an odd batch.
void check_trainable(const TrainingManifest& manifest);

}  // namespace eventgan
