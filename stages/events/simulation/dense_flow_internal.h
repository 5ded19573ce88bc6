#pragma once

#include <opencv2/core.hpp>

namespace eventgan {

/// Dense optical flow between two pictures [y, x] CV_8UC1 of one size: CV_32FC2, displacement (x,
/// y) in pixels of each pixel of `from` to its place in `to`, finite. OpenCV's DIS (Kroeger et al.
/// 2016), medium preset; pictures below 32 px a side are continued by their border. The result does
/// not depend on the number of threads (DIS searches in a fixed number of stripes). Thread safe.
cv::Mat dense_flow(const cv::Mat& from, const cv::Mat& to);

}  // namespace eventgan
