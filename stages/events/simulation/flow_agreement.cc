#include <algorithm>

#include "stages/events/simulation/flow_agreement_internal.h"
#include "stages/events/simulation/flow_warp_internal.h"

namespace eventgan {
namespace {

constexpr float kIntensityScale = 0.1f;
constexpr float kFlowScalePx = 1.0f;
constexpr float kLeast =
    1e-3f;  ///< a point that only one frame sees still counts where it is alone

}  // namespace

cv::Mat flow_agreement(const FlowFrame& frame, const FlowFrame& other) {
  const cv::Mat intensity_there = look_along(other.intensity, frame.flow, 1);
  const cv::Mat flow_back = look_along(other.flow, frame.flow, 1);
  cv::Mat agreement(frame.flow.size(), CV_32FC1, cv::Scalar(kLeast));
  for (int y = 0; y < agreement.rows; ++y) {
    for (int x = 0; x < agreement.cols; ++x) {
      const auto& flow = frame.flow.at<cv::Point2f>(y, x);
      const cv::Point2f there = cv::Point2f(cv::Point(x, y)) + flow;
      if (!lies_inside(there, agreement.size())) continue;
      const float change = intensity_there.at<float>(y, x) - frame.intensity.at<float>(y, x);
      const cv::Point2f missed = flow + flow_back.at<cv::Point2f>(y, x);
      agreement.at<float>(y, x) = std::max(
          trust(change * change, kIntensityScale) * trust(missed.dot(missed), kFlowScalePx),
          kLeast);
    }
  }
  return agreement;
}

}  // namespace eventgan
