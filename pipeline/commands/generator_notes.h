#pragma once

#include "pipeline/generation/load_generator.h"

namespace eventgan {

/// Tells on the standard error stream which engine was chosen, and the warnings.
void tell_generator(const LoadedGenerator& loaded);

}  // namespace eventgan
