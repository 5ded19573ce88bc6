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

/// Puts into a frozen plan what could not be known when it was frozen, as far as the inputs tell
/// now: samples that were planned with a fault (a hole in their sequence) become what they would be
/// planned as today, by source and id; shards of unknown size get that of their first picture that
/// can be read. What is unknown still stays as it is, and so do all slots. `datasets`: one for each
/// source, opened now.
void complete_plan(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan);

}  // namespace eventgan
