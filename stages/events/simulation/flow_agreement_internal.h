#pragma once

#include <opencv2/core.hpp>

namespace eventgan {

/// One of the two frames that an interval is interpolated from.
struct FlowFrame {
  cv::Mat intensity;  ///< [y, x] CV_32FC1 in [0, 1]
  cv::Mat flow;       ///< [y, x] CV_32FC2, displacement (x, y) in pixels to the other frame
  cv::Mat agreement;  ///< [y, x] CV_32FC1, flow_agreement to the other frame
};

/// How far the other frame confirms each pixel's flow, in (0, 1], [y, x] CV_32FC1: near 1 where the
/// flow leads to the same intensity and the flow there leads back; small where the point is covered
/// in the other frame or leaves the picture. Thread safe.
cv::Mat flow_agreement(const FlowFrame& frame, const FlowFrame& other);

}  // namespace eventgan
