#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

struct FrameSelection {
  std::vector<LabelledFrame> frames;
  std::vector<std::string> notes;  ///< for the plan: what the user should know of it, a line each
};

/// The labelled frames of a source that its selection takes, in the dataset's order; relative paths
/// start at `base`. Throws InputError if the list of ids cannot be read, or holds one that the
/// source does not have; if no frame has a subject, camera or action that is asked for; or if
/// nothing is left.
FrameSelection select_frames(const std::vector<LabelledFrame>& frames, const SourceSpec& spec,
                             const std::filesystem::path& base, std::uint64_t seed);

}  // namespace eventgan
