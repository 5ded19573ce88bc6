#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "pipeline/progress/progress.h"
#include "pipeline/realism/realism_options.h"
#include "pipeline/realism/realism_report.h"

namespace eventgan {

/// What `eventgan realism` does: chooses the pairs, opens the network, fits the models' thresholds
/// (on at most 16 pairs, spread evenly over the chosen ones), compares. `make_progress` is called
/// with the number of pairs; empty: silent. Volumes have as many bins as the network's, 9 without.
///
/// Throws UsageError for options that cannot be, InputError if recording or weights cannot be read.
RealismReport measure_realism(
    const Recording& recording, const RealismOptions& options,
    const std::function<std::unique_ptr<Progress>(std::int64_t)>& make_progress = {});

}  // namespace eventgan
