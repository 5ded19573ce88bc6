#include "stages/events/simulation/flow_interval.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <utility>

#include "stages/events/simulation/dense_flow_internal.h"
#include "stages/events/simulation/flow_agreement_internal.h"
#include "stages/events/simulation/flow_projection_internal.h"
#include "stages/events/simulation/flow_warp_internal.h"
#include "stages/events/simulation/linear_intensity.h"

namespace eventgan {
namespace {

constexpr int kMostSteps = 64;

cv::Mat intensity_of(const GreyImage& picture) {
  const std::vector<float> intensity = linear_intensity(picture);
  return cv::Mat(intensity, true).reshape(1, picture.size.height);
}

cv::Mat grey_of(const GreyImage& picture) {
  return cv::Mat(picture.pixels, true).reshape(1, picture.size.height);
}

int steps_for(const cv::Mat& forward, const cv::Mat& backward) {
  std::vector<float> lengths;
  lengths.reserve(2 * forward.total());
  for (const cv::Mat& flow : {forward, backward}) {
    for (const cv::Point2f& displacement : cv::Mat_<cv::Point2f>(flow)) {
      lengths.push_back(std::hypot(displacement.x, displacement.y));
    }
  }
  const auto rank = static_cast<std::ptrdiff_t>(0.995 * static_cast<double>(lengths.size() - 1));
  std::ranges::nth_element(lengths, lengths.begin() + rank);
  const float length = lengths[static_cast<std::size_t>(rank)];
  return static_cast<int>(std::clamp(std::ceil(length), 1.0f, static_cast<float>(kMostSteps)));
}

std::vector<float> values(const cv::Mat& intensity) {
  const auto* first = intensity.ptr<float>();
  return {first, first + intensity.total()};
}

/// How far `frame` sees what moves by `flow` through each pixel, looking from the pixel by `part`
/// of that flow; `sign` turns the frame's own flow into that from previous to next.
cv::Mat visible(const FlowFrame& frame, const cv::Mat& flow, float part, float sign) {
  constexpr float kFlowScalePx = 1.0f;
  constexpr float kLeast = 0.01f;  // where neither frame sees the point, both count
  const cv::Mat own = look_along(frame.flow, flow, part);
  cv::Mat visibility(flow.size(), CV_32FC1, cv::Scalar(kLeast));
  for (int y = 0; y < flow.rows; ++y) {
    for (int x = 0; x < flow.cols; ++x) {
      const auto& displacement = flow.at<cv::Point2f>(y, x);
      if (!lies_inside(cv::Point2f(cv::Point(x, y)) + part * displacement, flow.size())) continue;
      const cv::Point2f other = sign * own.at<cv::Point2f>(y, x) - displacement;
      visibility.at<float>(y, x) = std::max(trust(other.dot(other), kFlowScalePx), kLeast);
    }
  }
  return visibility;
}

}  // namespace

struct FlowInterval::Frames {
  FlowFrame previous;
  FlowFrame next;
};

FlowInterval::FlowInterval(const GreyImage& previous, const GreyImage& next) {
  if (previous.size != next.size) {
    throw std::invalid_argument("expected two frames of one size");
  }
  Frames frames{.previous = {.intensity = intensity_of(previous), .flow = {}, .agreement = {}},
                .next = {.intensity = intensity_of(next), .flow = {}, .agreement = {}}};
  try {
    frames.previous.flow = dense_flow(grey_of(previous), grey_of(next));
    frames.next.flow = dense_flow(grey_of(next), grey_of(previous));
    frames.previous.agreement = flow_agreement(frames.previous, frames.next);
    frames.next.agreement = flow_agreement(frames.next, frames.previous);
  } catch (const cv::Exception&) {
    std::throw_with_nested(std::runtime_error("the optical flow failed in OpenCV"));
  }
  steps_ = steps_for(frames.previous.flow, frames.next.flow);
  frames_ = std::make_unique<const Frames>(std::move(frames));
}

FlowInterval::~FlowInterval() = default;

ImageSize FlowInterval::size() const {
  return {frames_->previous.intensity.rows, frames_->previous.intensity.cols};
}

std::vector<float> FlowInterval::render(int step) const {
  const auto& [previous, next] = *frames_;
  if (step <= 0) return values(previous.intensity);
  if (step >= steps_) return values(next.intensity);
  const float u = static_cast<float>(step) / static_cast<float>(steps_);
  const cv::Mat flow = project_flow(previous, next, u);
  const cv::Mat before = look_along(previous.intensity, flow, -u);
  const cv::Mat after = look_along(next.intensity, flow, 1 - u);
  const cv::Mat before_weight = (1 - u) * visible(previous, flow, -u, 1);
  const cv::Mat after_weight = u * visible(next, flow, 1 - u, -1);
  const cv::Mat sum = before.mul(before_weight) + after.mul(after_weight);
  return values(sum / (before_weight + after_weight));
}

FlowDisplacement FlowInterval::flow() const {
  const cv::Mat& flow = frames_->previous.flow;
  FlowDisplacement result{.size = size(), .x_px = {}, .y_px = {}};
  for (const cv::Point2f& displacement : cv::Mat_<cv::Point2f>(flow)) {
    result.x_px.push_back(displacement.x);
    result.y_px.push_back(displacement.y);
  }
  return result;
}

}  // namespace eventgan
