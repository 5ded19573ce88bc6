#pragma once

#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/plan.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// What becomes of one labelled frame.
struct PairChoiceResult {
  std::vector<PlannedSample> samples;
  /// Gaps whose partner lies beyond the sequence's ends or pairs.max_gap_s (with choose = one: all
  /// of them, or none).
  std::vector<int> without_partner;
};

/// Chooses the frame pairs of a labelled frame (DESIGN section 3).
///
/// choose = one: one of the gaps whose frames exist, drawn by (seed, dataset, sample id), so that
/// no other source, sample or order of files changes the draw. choose = all: each gap; the gap and
/// side are added to the sample id as "ID@before2". A gap that meets a hole in the sequence becomes
/// a sample with a fault that names the missing file (choose = one: only if no gap can be had). All
/// pairs of a frame that is itself at fault (LabelledFrame::fault) have that fault.
PairChoiceResult choose_pairs(const Dataset& dataset, const LabelledFrame& frame,
                              const SourceSpec& source, std::uint64_t seed);

/// Gives a sample that was planned earlier what its labelled frame says today: the label's key, the
/// frames' times, and the fault of the frame, if it has one. Its frames stay.
void renew_sample(const Dataset& dataset, const LabelledFrame& frame, const SourceSpec& source,
                  PlannedSample& sample);

}  // namespace eventgan
