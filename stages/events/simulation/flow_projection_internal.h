#pragma once

#include <opencv2/core.hpp>

#include "stages/events/simulation/flow_agreement_internal.h"

namespace eventgan {

/// Flow previous → next of what stands at each pixel at the time u in (0, 1): CV_32FC2, pixels.
/// Both frames' flows are carried along themselves to the time u and averaged where they land, by
/// distance (bilinear), agreement and nearness in time (forward splatting: Baker et al. 2011,
/// section 3.3.2; weights as in softmax splatting, Niklaus and Liu 2020). Where nothing lands, the
/// frames' flows at that pixel count. Continuous in u. Thread safe.
cv::Mat project_flow(const FlowFrame& previous, const FlowFrame& next, float u);

}  // namespace eventgan
