#pragma once

#include <functional>
#include <span>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/realism/real_interval.h"
#include "pipeline/tradeoff/compared_pairs.h"
#include "pipeline/tradeoff/configuration.h"
#include "pipeline/tradeoff/loss.h"
#include "pipeline/tradeoff/tradeoff.h"
#include "stages/events/realism/realism_scores.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

// These take pairs of the computation's size on up to `threads` threads. `each` is called after
// each pair by the thread that worked on it. They throw Stopped on a request to stop, UsageError or
// InputError as load_generator does, what `each` throws.

/// Of each of `dtypes` the losses, as measure_tradeoff defines them, of the pairs that can be
/// compared, in their order.
std::vector<std::vector<PairLoss>> measure_losses(ComparedPairs& pairs,
                                                  const Computation& computation,
                                                  std::span<const StoredType> dtypes, int threads,
                                                  const std::function<void()>& each);

/// What each of `dtypes` costs in one turn of the computation, without `reference_s`: all pairs are
/// generated once and finished for each type, in the graph of a conversion, without a disk. The
/// first pair of each size of frames is generated once more before that, since it waits for the
/// engine's plan.
std::vector<RoundCost> take_turn(ComparedPairs& pairs, const Computation& computation,
                                 std::span<const StoredType> dtypes, int threads,
                                 const std::function<void()>& each);

/// What is scored of a recording, which must outlive it.
struct RealPart {
  const Recording& recording;
  std::vector<FrameInterval> intervals;  ///< between neighbouring frames
};

/// At most `most` intervals, spread evenly over the recording. Throws UsageError if there is none,
/// InputError as Recording does.
RealPart part_of(const Recording& recording, int most);

/// How volumes of the frames compare with the camera's, means over the intervals: made by the job's
/// generator from frames of `size` times their sides, stored in each of `dtypes` and read back
/// (a simulator's counts divided by their 98th percentile), laid on the camera's grid. `each` is
/// called after each interval by the thread that worked on it; what it throws ends the work. Throws
/// as part_of and load_generator do.
std::vector<RealismScores> real_scores(const RealPart& part, const JobManifest& job, double size,
                                       std::span<const StoredType> dtypes, int threads,
                                       const std::function<void()>& each);

}  // namespace eventgan
