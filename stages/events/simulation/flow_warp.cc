#include <opencv2/imgproc.hpp>

#include "stages/events/simulation/flow_warp_internal.h"

namespace eventgan {

cv::Mat look_along(const cv::Mat& source, const cv::Mat& flow, float part) {
  cv::Mat places(flow.size(), CV_32FC2);
  for (int y = 0; y < flow.rows; ++y) {
    const auto* displacement = flow.ptr<cv::Point2f>(y);
    auto* place = places.ptr<cv::Point2f>(y);
    for (int x = 0; x < flow.cols; ++x) {
      place[x] = cv::Point2f(static_cast<float>(x), static_cast<float>(y)) + part * displacement[x];
    }
  }
  cv::Mat seen;
  cv::remap(source, seen, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REFLECT_101);
  return seen;
}

}  // namespace eventgan
