#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"

namespace eventgan {

/// Everything that changes a shard's bytes, field by field: each setting of the manifest (see
/// manifest_fields), annotations, frames, weights, engine, preprocessing, cpu, libraries, program,
/// the time axis of cropped events, and the tiles that persons get. make_plan adds what the labels'
/// numbers mean ("labels 0 class 2", Dataset::label_meanings). Annotation files are hashed by
/// content; frames by path and size only, since their content would mean reading everything twice,
/// and by what the plan takes from the inputs: samples, times, sizes, faults, counts. Libraries are
/// those that are loaded (FFmpeg where frames come from videos), not those compiled against.
/// `before_file` is called for each mention of a file, of which the first has it looked at:
/// `annotation_files`, and two frames a pair; what it throws is passed on.
std::map<std::string, std::string> make_fingerprint(
    const JobManifest& manifest, const Plan& plan, const std::vector<std::string>& annotation_files,
    const std::string& weights_hash, const std::string& engine,
    const std::function<void()>& before_file = [] {});

/// How frames are prepared, as compact JSON; is in the fingerprint and in every shard.
std::string preprocessing_json(const ImageSpec& image);

/// Name and version of this program: "eventgan 1.0.0".
std::string program_version();

/// That and what else decides over a shard's bytes: the libraries that are loaded, the engines, the
/// processor; a line each, without the last line's end.
std::string version_text();

}  // namespace eventgan
