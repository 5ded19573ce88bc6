#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/realism/real_interval.h"
#include "stages/events/realism/realism_scores.h"
#include "stages/recordings/recording.h"

namespace eventgan {

/// What is scored of a recording, which must outlive it.
struct RealPart {
  const Recording& recording;
  std::vector<FrameInterval> intervals;  ///< between neighbouring frames
  std::string content;  ///< SHA-256 of all that scores are made from: frames and camera's volumes
};

/// At most `most` intervals, spread evenly over the recording. Throws UsageError if there is none,
/// InputError as Recording does.
RealPart part_of(const Recording& recording, int most, int bins, int threads);

/// How volumes of the frames compare with the camera's, means over the intervals: made by the job's
/// generator from frames of `size` times their sides, stored in each of `dtypes` and read back
/// (a simulator's counts divided by their 98th percentile), laid on the camera's grid. `each` is
/// called after each interval by the thread that worked on it; what it throws ends the work. Throws
/// as part_of and load_generator do.
std::vector<RealismScores> real_scores(const RealPart& part, const JobManifest& job, double size,
                                       std::span<const StoredType> dtypes, int threads,
                                       const std::function<void()>& each);

}  // namespace eventgan
