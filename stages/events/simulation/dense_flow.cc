#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "stages/events/simulation/dense_flow_internal.h"

namespace eventgan {
namespace {

/// DIS needs some patches of 8 px at its coarsest scale.
constexpr int kSmallestSide = 32;

cv::Mat continued(const cv::Mat& picture) {
  cv::Mat result;
  cv::copyMakeBorder(picture, result, 0, std::max(kSmallestSide - picture.rows, 0), 0,
                     std::max(kSmallestSide - picture.cols, 0), cv::BORDER_REPLICATE);
  return result;
}

}  // namespace

cv::Mat dense_flow(const cv::Mat& from, const cv::Mat& to) {
  cv::Mat flow;
  cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM)
      ->calc(continued(from), continued(to), flow);
  cv::Mat result = flow(cv::Rect(0, 0, from.cols, from.rows)).clone();
  cv::patchNaNs(result, 0);
  return result;
}

}  // namespace eventgan
