#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "pipeline/realism/realism_report.h"
#include "pipeline/realism/volume_method.h"

namespace eventgan {

struct ComparisonRun {
  int bins = 9;
  int threads = 1;
  std::filesystem::path images;       ///< folder that exists; empty: none
  std::function<void()> on_interval;  ///< called after each interval, one call at a time
};

/// Scores each method's volumes of the intervals against the camera's, intervals in parallel; the
/// result does not depend on the number of threads. Draws FIRST-LAST.png for each interval
/// (write_comparison_png): the real volume and each method's first draw, as they are compared.
///
/// Throws InputError if the recording cannot be read, std::runtime_error if a method makes a volume
/// that is not finite or an image cannot be written. Fills `intervals`, `real` and `methods` of
/// the report, and what it knows of the recording.
RealismReport compare_volumes(const Recording& recording, std::span<const FrameInterval> intervals,
                              std::span<const std::unique_ptr<VolumeMethod>> methods,
                              const ComparisonRun& run);

}  // namespace eventgan
