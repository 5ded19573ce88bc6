#pragma once

#include <string>

#include "manifests/job_manifest.h"
#include "manifests/plan.h"
#include "pipeline/conversion/trial.h"

namespace eventgan {

/// What `eventgan plan` prints: for each source its labelled frames, pairs by gap, what is missing,
/// its shards; then the estimate for the whole.
std::string plan_text(const JobManifest& manifest, const Plan& plan, const TrialEstimate& estimate,
                      int threads);

/// The same as JSON.
std::string plan_summary_json(const JobManifest& manifest, const Plan& plan,
                              const TrialEstimate& estimate, int threads);

}  // namespace eventgan
