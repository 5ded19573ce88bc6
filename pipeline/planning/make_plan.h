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

/// Gives every sample of a frozen plan what its labelled frame says today (renew_sample): times and
/// faults may have been mended, and the key of a label may be its row in an annotation file, where
/// rows move. A sample whose frame is not labelled any more gets a fault, since another's label may
/// stand in its row. `datasets`: one for each source, opened now; null where a source is not there,
/// whose samples stay as they are.
void renew_samples(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan);

/// Puts into a frozen plan what could not be known when it was frozen, as far as the inputs tell
/// now: samples that were planned with a fault (a hole in their sequence) become what they would be
/// planned as today, by source and id; all others are renewed (renew_samples); shards of unknown
/// size get that of their first picture that can be read. What is unknown still stays as it is, and
/// so do all slots. `datasets` as above, none null.
void complete_plan(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan);

}  // namespace eventgan
