#pragma once

#include <cstdint>
#include <vector>

#include "stages/frames/dataset/dataset.h"
#include "stages/frames/naming/own_labels.h"

namespace eventgan {

/// FrameRef::index of a frame that labels name and the source does not have: whatever is paired
/// with it is missing.
inline constexpr std::int64_t kAbsentFrame = -1;

/// Adds these frames to the labelled ones, and checks that there are any now. A sample_id is the
/// name without its extension; whole, where another frame has that already. Throws InputError if no
/// frame has a label, absent ones neither.
void add_absent_frames(const OwnLabels& labels, std::vector<LabelledFrame>& frames);

}  // namespace eventgan
