#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/plan.h"
#include "pipeline/profile/trace_recorder.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// A plan, and the opened datasets it was made from (their annotations are read while converting).
struct PlannedJob {
  Plan plan;
  std::vector<std::unique_ptr<Dataset>> datasets;  ///< one for each source of the manifest
};

/// Opens every source and decides everything that is random or depends on what is on disk. Freezes
/// and writes nothing. Throws InputError if a source is missing or yields fewer pairs than its
/// min_pairs.
///
/// A million frames on a network file system take minutes to look at: `stop` is asked for each, and
/// if it says yes, Stopped is thrown. None: nobody asks. `trace` gets what takes time; null: nobody
/// asks.
PlannedJob make_plan(const JobManifest& manifest, const std::string& weights_hash,
                     const std::string& engine, const std::function<bool()>& stop = {},
                     TraceRecorder* trace = nullptr);

/// Gives every shard of a frozen plan whose size was unknown then the size of its first picture
/// that can be read now; where none can be, the guess stays. Nothing else in the plan changes.
void settle_sizes(const JobManifest& manifest, Plan& plan);

}  // namespace eventgan
