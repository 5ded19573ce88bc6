#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "pipeline/conversion/sample_stages.h"
#include "pipeline/generators/calibrate.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/tradeoff/configuration.h"

namespace eventgan {

/// A job whose configurations are compared, planned, and the pairs on which they are.
struct ComparedJob {
  /// Plans `manifest`, which must outlive this, and chooses up to `pairs` of its pairs, spread
  /// evenly (choose_calibration_samples). `stop_requested` may be none. Throws as make_plan does.
  ComparedJob(const JobManifest& manifest, int pairs, std::function<bool()> stop_requested);

  /// The job as a computation with a stored type runs it. Throws as trial_job does.
  TrialJob as(const Computation& computation, StoredType dtype) const;

  /// Throws Stopped if that is requested.
  void check_stop() const;

  const JobManifest& manifest;
  PlannedJob planned;
  /// The volumes' size where the manifest does not say it; none if there are several, or it is not
  /// known.
  std::optional<ImageSize> whole;
  std::vector<CalibrationSample> samples;  ///< into the plan
  std::function<bool()> stop_requested;
};

/// The chosen pairs as the generator gets them, in one size.
struct SizedPairs {
  double size = 0;                   ///< of the volume's sides, 1 as in the manifest
  std::vector<PlannedShard> shards;  ///< each pair alone in one
  std::vector<SampleMessage> pairs;  ///< read; some have failed
  double read_s = 0;                 ///< processor time to read a pair in a conversion

  /// Of the frames.
  double held_bytes() const;
};

/// The pairs of a job in the reference's size, which are kept, and in one other. For one thread at
/// a time.
class ComparedPairs {
 public:
  /// Reads those of the reference. `job` must outlive this. Throws Stopped on a request to stop.
  ComparedPairs(const ComparedJob& job, const Computation& reference);
  ComparedPairs(const ComparedPairs&) = delete;  // messages point into the shards beside them
  ComparedPairs& operator=(const ComparedPairs&) = delete;

  const ComparedJob& job() const { return job_; }
  const Computation& reference_computation() const { return reference_computation_; }
  const SizedPairs& reference() const { return reference_; }

  /// Those of `size`, read unless they are held; valid until another size is asked for. Throws as
  /// the constructor does.
  const SizedPairs& of(double size);

  /// Of the frames of all that is held.
  double held_bytes() const { return reference_.held_bytes() + other_.held_bytes(); }

 private:
  SizedPairs read(double size) const;

  const ComparedJob& job_;
  Computation reference_computation_;
  SizedPairs reference_;
  SizedPairs other_;  ///< of the size at work, if that is another
};

}  // namespace eventgan
