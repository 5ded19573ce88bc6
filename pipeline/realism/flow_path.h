#pragma once

#include <optional>

#include "pipeline/realism/real_interval.h"

namespace eventgan {

/// The true displacement over an interval of several frames: each pixel of the first frame is
/// carried along the flows of the frame intervals, u_k(x) = u_{k-1}(x) + f_k(x + u_{k-1}(x)),
/// bilinear between pixels. An approximation: where another surface comes in front on the way, the
/// pixel goes on with that surface. NaN where the path leaves the picture or the flow is not known.
/// None if the recording does not know its flow. Throws InputError as Recording does. Thread safe.
std::optional<FlowField> flow_path(const Recording& recording, const FrameInterval& interval);

}  // namespace eventgan
