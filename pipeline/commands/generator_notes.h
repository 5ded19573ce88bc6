#pragma once

#include "pipeline/generation/load_generator.h"

namespace eventgan {

/// Tells on the standard error stream which engine was chosen, and the warnings; a JSON line each
/// if `as_json`.
void tell_generator(const LoadedGenerator& loaded, bool as_json);

}  // namespace eventgan
