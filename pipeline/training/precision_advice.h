#pragma once

#include <string>

#include "manifests/training_manifest.h"

namespace eventgan {

/// A warning that bfloat16 is slower than float32 where the processor has no instructions for it;
/// empty where nothing speaks against the precision. `instructions`: as instruction_sets() gives.
std::string precision_advice(TrainingPrecision precision, const std::string& device,
                             const std::string& instructions);

}  // namespace eventgan
