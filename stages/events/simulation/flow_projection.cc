#include <cmath>

#include "stages/events/simulation/flow_projection_internal.h"

namespace eventgan {
namespace {

/// Σ w f and Σ w of what landed on each pixel: CV_32FC3 (x, y, weight).
using Landed = cv::Mat_<cv::Vec3f>;

void land(Landed& landed, int x, int y, const cv::Point2f& flow, float weight) {
  if (x < 0 || y < 0 || x >= landed.cols || y >= landed.rows) return;
  landed(y, x) += cv::Vec3f(weight * flow.x, weight * flow.y, weight);
}

/// Carries each pixel by `part` of its flow. `sign` turns its flow into that from previous to next.
void carry(Landed& landed, const FlowFrame& frame, float part, float sign, float frame_weight) {
  const cv::Rect2f reach(-1, -1, static_cast<float>(landed.cols + 1),
                         static_cast<float>(landed.rows + 1));
  for (int y = 0; y < landed.rows; ++y) {
    for (int x = 0; x < landed.cols; ++x) {
      const auto& flow = frame.flow.at<cv::Point2f>(y, x);
      const cv::Point2f place = cv::Point2f(cv::Point(x, y)) + part * flow;
      if (!reach.contains(place)) continue;
      const int left = static_cast<int>(std::floor(place.x));
      const int top = static_cast<int>(std::floor(place.y));
      const float right_part = place.x - static_cast<float>(left);
      const float bottom_part = place.y - static_cast<float>(top);
      const float weight = frame_weight * frame.agreement.at<float>(y, x);
      const cv::Point2f forward = sign * flow;
      land(landed, left, top, forward, weight * (1 - right_part) * (1 - bottom_part));
      land(landed, left + 1, top, forward, weight * right_part * (1 - bottom_part));
      land(landed, left, top + 1, forward, weight * (1 - right_part) * bottom_part);
      land(landed, left + 1, top + 1, forward, weight * right_part * bottom_part);
    }
  }
}

}  // namespace

cv::Mat project_flow(const FlowFrame& previous, const FlowFrame& next, float u) {
  // Far below the weight of anything that lands: counts in gaps only.
  constexpr float kGapWeight = 1e-6f;
  Landed landed(previous.flow.size(), cv::Vec3f::all(0));
  carry(landed, previous, u, 1, 1 - u);
  carry(landed, next, 1 - u, -1, u);
  cv::Mat result(landed.size(), CV_32FC2);
  for (int y = 0; y < landed.rows; ++y) {
    for (int x = 0; x < landed.cols; ++x) {
      const cv::Point2f here =
          (1 - u) * previous.flow.at<cv::Point2f>(y, x) - u * next.flow.at<cv::Point2f>(y, x);
      const cv::Vec3f& sum = landed(y, x);
      result.at<cv::Point2f>(y, x) =
          (cv::Point2f(sum[0], sum[1]) + kGapWeight * here) / (sum[2] + kGapWeight);
    }
  }
  return result;
}

}  // namespace eventgan
