#pragma once

#include "pipeline/generation/choose_engine.h"

namespace eventgan {

/// What there is for a precision on the processor that runs this, as oneDNN sees it
/// (ONEDNN_MAX_CPU_ISA minded).
EngineSupport engine_support(Precision precision);

}  // namespace eventgan
