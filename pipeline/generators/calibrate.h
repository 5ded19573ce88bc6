#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/progress.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// A sample of a plan that takes part in a calibration.
struct CalibrationSample {
  const PlannedShard* shard = nullptr;
  int slot = 0;
  bool held_out = false;  ///< for measuring the error, not for the calibration

  const PlannedSample& planned() const { return shard->samples[static_cast<std::size_t>(slot)]; }
};

/// Up to `pairs` samples to calibrate on and up to `held_out` others, spread evenly over the plan's
/// samples without known faults and in the plan's order, so that each source has its share: of T
/// samples the first of each T / (pairs + held_out), and of these every so many is held out. Of few
/// samples at most a fifth is held out. Pure; the result points into the plan.
std::vector<CalibrationSample> choose_calibration_samples(const Plan& plan, int pairs,
                                                          int held_out);

/// How far `volume` is from `reference`, both of one size: ‖volume - reference‖ / ‖reference‖ in
/// the Euclidean norm, summed in double. Of a reference of zeros: 0 if the volume is zeros too,
/// else infinity. Pure.
double relative_distance(std::span<const float> volume, std::span<const float> reference);

inline constexpr int kDefaultCalibrationPairs = 32;
inline constexpr int kHeldOutPairs = 8;

struct CalibrationOptions {
  int pairs = kDefaultCalibrationPairs;  ///< ≥ 1
  int held_out = kHeldOutPairs;          ///< other pairs, on which the error is measured
  std::function<bool()> stop_requested;  ///< none: never
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

/// Where calibrated weights go: `out` if it is given; else beside the manifest
/// "FILE-calibrated.safetensors", for the program's own weights
/// "eventgan-WIDTH-calibrated.safetensors" or "eventgan-sensor-calibrated.safetensors", for random
/// ones "untrained-WIDTH-calibrated.safetensors". `base_channels` is the weights' WIDTH.
///
/// Throws UsageError if `out` is not named *.safetensors or its folder is not there, or if the
/// default is the very file that is calibrated: only who names it overwrites it.
std::filesystem::path calibrated_file(const JobManifest& manifest, int base_channels,
                                      const std::optional<std::string>& out);

/// The line for the manifest: "generator": { "weights": "FILE", "precision": "int8" }, FILE
/// relative to the manifest's folder if it lies there or below, else absolute.
std::string calibrated_generator_line(const JobManifest& manifest,
                                      const std::filesystem::path& file);

}  // namespace eventgan
