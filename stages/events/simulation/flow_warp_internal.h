#pragma once

#include <opencv2/core.hpp>

namespace eventgan {

/// W(x) = source(x + part · flow(x)), bilinear with places rounded to 1/32 px (cv::remap), mirrored
/// outside the picture (reflect-101). source: CV_32F, any channels; flow: CV_32FC2 of the same
/// size, displacement (x, y) in pixels. Thread safe.
cv::Mat look_along(const cv::Mat& source, const cv::Mat& flow, float part);

/// Whether the place lies on the picture: within half a pixel of a pixel's centre.
inline bool lies_inside(const cv::Point2f& place, const cv::Size& size) {
  return place.x >= -0.5f && place.y >= -0.5f && place.x < static_cast<float>(size.width) - 0.5f &&
         place.y < static_cast<float>(size.height) - 0.5f;
}

/// 1 where `error` is 0, 1/4 where it equals `scale`, and falling with its fourth power.
inline float trust(float squared_error, float scale) {
  const float root = 1.0f / (1.0f + squared_error / (scale * scale));
  return root * root;
}

}  // namespace eventgan
