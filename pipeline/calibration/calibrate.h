#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/progress/progress.h"
#include "stages/generator/weights.h"

namespace eventgan {

inline constexpr int kDefaultCalibrationPairs = 32;
inline constexpr int kHeldOutPairs = 8;

struct CalibrationOptions {
  int pairs = kDefaultCalibrationPairs;  ///< ≥ 1
  int held_out = kHeldOutPairs;          ///< other pairs, on which the error is measured
  std::function<bool()> stop_requested;  ///< none: nobody asks
  /// Called with the number of pairs to work on; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
};

struct CalibrationOutcome {
  Weights weights;                   ///< the ones given, with their calibration
  std::vector<std::string> skipped;  ///< "SAMPLE: reason" of pairs that cannot be read
  /// Of each held-out pair, the relative_distance of its int8 volume from the float32 reference's;
  /// empty if none could be read, or `unmeasured` says why.
  std::vector<double> distances;
  std::string unmeasured;  ///< not empty: why int8 cannot be computed here
};

/// Collects a calibration of `weights` from pairs of the job, spread evenly over it
/// (choose_calibration_samples) and prepared exactly as convert does; samples that convert would
/// quarantine are skipped. Then measures what int8 costs on pairs that took no part. Works on the
/// calling thread; the same job gives the same calibration.
///
/// Throws InputError if no pair can be read, Stopped on a request to stop.
CalibrationOutcome calibrate(const JobManifest& manifest, const PlannedJob& job,
                             const Weights& weights, const CalibrationOptions& options);

}  // namespace eventgan
