#pragma once

#include <string>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "pipeline/planning/make_plan.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// What a job will cost, measured on a few of its own pairs and scaled by image size.
struct TrialEstimate {
  int pairs_measured = 0;
  double seconds_per_pair = 0;  ///< on one thread, mean over the plan
  double seconds = 0;           ///< wall time with the given threads
  double stored_bytes = 0;      ///< compressed volumes and flow
};

/// Runs pairs of each source through reading, generating and encoding on the calling thread: of
/// stills up to `most` spread over it, of sequences and clips up to min(most, 4) from its start;
/// after one more, which counts only where no other could be tried. Scales by source and image
/// size. Pairs that fail are left out.
TrialEstimate measure_trial(const JobManifest& manifest, const PlannedJob& job,
                            const Generator& generator, int threads, int most = 16);

/// What `eventgan plan` prints: for each source its labelled frames, pairs by gap, what is missing,
/// its shards; then the estimate for the whole.
std::string plan_text(const JobManifest& manifest, const PlannedJob& job,
                      const TrialEstimate& estimate, int threads);

/// The same as JSON.
std::string plan_summary_json(const JobManifest& manifest, const PlannedJob& job,
                              const TrialEstimate& estimate, int threads);

}  // namespace eventgan
