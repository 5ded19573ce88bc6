#include "stages/events/simulation/flow_interval.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <stdexcept>
#include <utility>

#include "stages/events/simulation/sensor.h"

namespace eventgan {

/// One of the two frames that an interval is interpolated from.
struct FlowFrame {
  cv::Mat intensity;  ///< [y, x] CV_32FC1 in [0, 1]
  cv::Mat flow;       ///< [y, x] CV_32FC2, displacement (x, y) in pixels to the other frame
  cv::Mat agreement;  ///< [y, x] CV_32FC1, flow_agreement to the other frame
};

namespace {

/// DIS needs some patches of 8 px at its coarsest scale.
constexpr int kSmallestSide = 32;

cv::Mat continued(const cv::Mat& image) {
  cv::Mat result;
  cv::copyMakeBorder(image, result, 0, std::max(kSmallestSide - image.rows, 0), 0,
                     std::max(kSmallestSide - image.cols, 0), cv::BORDER_REPLICATE);
  return result;
}

/// Dense optical flow between two images [y, x] CV_8UC1 of one size: CV_32FC2, displacement (x,
/// y) in pixels of each pixel of `from` to its place in `to`, finite. OpenCV's DIS (Kroeger et al.
/// 2016), medium preset; images below 32 px a side are continued by their border. The result does
/// not depend on the number of threads (DIS searches in a fixed number of stripes). Thread safe.
cv::Mat dense_flow(const cv::Mat& from, const cv::Mat& to) {
  cv::Mat flow;
  cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM)
      ->calc(continued(from), continued(to), flow);
  cv::Mat result = flow(cv::Rect(0, 0, from.cols, from.rows)).clone();
  cv::patchNaNs(result, 0);
  return result;
}

/// Whether the place lies on the image: within half a pixel of a pixel's centre.
inline bool lies_inside(const cv::Point2f& place, const cv::Size& size) {
  return place.x >= -0.5f && place.y >= -0.5f && place.x < static_cast<float>(size.width) - 0.5f &&
         place.y < static_cast<float>(size.height) - 0.5f;
}

/// 1 where `error` is 0, 1/4 where it equals `scale`, and falling with its fourth power.
inline float trust(float squared_error, float scale) {
  const float root = 1.0f / (1.0f + squared_error / (scale * scale));
  return root * root;
}

/// W(x) = source(x + part · flow(x)), bilinear with places rounded to 1/32 px (cv::remap), mirrored
/// outside the image (reflect-101). source: CV_32F, any channels; flow: CV_32FC2 of the same
/// size, displacement (x, y) in pixels. Thread safe.
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

constexpr float kIntensityScale = 0.1f;
constexpr float kFlowBackScalePx = 1.0f;
constexpr float kLeastAgreement =
    1e-3f;  ///< a point that only one frame sees still counts where it is alone

/// How far the other frame confirms each pixel's flow, in (0, 1], [y, x] CV_32FC1: near 1 where the
/// flow leads to the same intensity and the flow there leads back; small where the point is covered
/// in the other frame or leaves the image. Thread safe.
cv::Mat flow_agreement(const FlowFrame& frame, const FlowFrame& other) {
  const cv::Mat intensity_there = look_along(other.intensity, frame.flow, 1);
  const cv::Mat flow_back = look_along(other.flow, frame.flow, 1);
  cv::Mat agreement(frame.flow.size(), CV_32FC1, cv::Scalar(kLeastAgreement));
  for (int y = 0; y < agreement.rows; ++y) {
    for (int x = 0; x < agreement.cols; ++x) {
      const auto& flow = frame.flow.at<cv::Point2f>(y, x);
      const cv::Point2f there = cv::Point2f(cv::Point(x, y)) + flow;
      if (!lies_inside(there, agreement.size())) continue;
      const float change = intensity_there.at<float>(y, x) - frame.intensity.at<float>(y, x);
      const cv::Point2f missed = flow + flow_back.at<cv::Point2f>(y, x);
      agreement.at<float>(y, x) = std::max(
          trust(change * change, kIntensityScale) * trust(missed.dot(missed), kFlowBackScalePx),
          kLeastAgreement);
    }
  }
  return agreement;
}

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

/// Flow previous → next of what is at each pixel at the time u in (0, 1): CV_32FC2, pixels.
/// Both frames' flows are carried along themselves to the time u and averaged where they land, by
/// distance (bilinear), agreement and nearness in time (forward splatting: Baker et al. 2011,
/// section 3.3.2; weights as in softmax splatting, Niklaus and Liu 2020). Where nothing lands, the
/// frames' flows at that pixel count. Continuous in u. Thread safe.
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

constexpr int kMostSteps = 64;

cv::Mat intensity_of(const GreyImage& image) {
  const std::vector<float> intensity = linear_intensity(image);
  return cv::Mat(intensity, true).reshape(1, image.size.height);
}

cv::Mat grey_of(const GreyImage& image) {
  return cv::Mat(image.pixels, true).reshape(1, image.size.height);
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
