#include "stages/events/simulation/affine_motion.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/events/simulation/sensor.h"

namespace eventgan {
namespace {

using Corners = std::array<cv::Vec2d, 4>;

/// The corner pixels' centres as seen from the image's centre.
Corners corners_about_centre(ImageSize size) {
  const double x = 0.5 * (size.width - 1);
  const double y = 0.5 * (size.height - 1);
  return {cv::Vec2d{-x, -y}, {x, -y}, {-x, y}, {x, y}};
}

double largest_length(const cv::Matx22d& matrix, const Corners& corners) {
  double largest = 0;
  for (const cv::Vec2d& corner : corners) largest = std::max(largest, cv::norm(matrix * corner));
  return largest;
}

/// Rotation, zoom, stretch and shear with weights of their own in [-1, 1).
cv::Matx22d random_linear_part(CounterRandom random) {
  std::array<double, 4> weights;
  for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = 2 * random.uniform(i) - 1;
  const auto [rotation, zoom, stretch, shear] = weights;
  return {zoom + stretch, shear - rotation, shear + rotation, zoom - stretch};
}

/// The longest step along `direction` that, added to the linear part, moves no corner farther than
/// `displacement`: the smallest positive root over the corners of |step · direction + G corner| =
/// displacement.
double translation_length(const cv::Matx22d& linear, const Corners& corners,
                          const cv::Vec2d& direction, double displacement) {
  double length = std::numeric_limits<double>::infinity();
  for (const cv::Vec2d& corner : corners) {
    const cv::Vec2d moved = linear * corner;
    const double along = direction.dot(moved);
    const double inside = along * along + displacement * displacement - moved.dot(moved);
    length = std::min(length, std::sqrt(std::max(inside, 0.0)) - along);
  }
  return length;
}

cv::Vec2d displacement_at(const AffineMotion& motion, double x, double y) {
  const auto& m = motion.matrix;
  return {(m[0] - 1) * x + m[1] * y + m[2], m[3] * x + (m[4] - 1) * y + m[5]};
}

}  // namespace

AffineMotion random_affine_motion(ImageSize size, double displacement_px, CounterRandom random) {
  if (!std::isfinite(displacement_px) || displacement_px < 0) {
    throw std::invalid_argument("expected a displacement >= 0 px, got " +
                                std::to_string(displacement_px));
  }
  const Corners corners = corners_about_centre(size);
  cv::Matx22d linear = random_linear_part(random.keyed("linear"));
  if (const double largest = largest_length(linear, corners); largest > 0) {
    linear = linear * (displacement_px * random.uniform(0) / largest);
    linear = linear * (0.5 / std::max(0.5, cv::norm(linear)));
  } else {
    linear = cv::Matx22d::zeros();  // an image of one pixel has no linear motion
  }
  const double angle = 2 * std::numbers::pi * random.uniform(1);
  const cv::Vec2d direction(std::cos(angle), std::sin(angle));
  const cv::Vec2d translation =
      direction * translation_length(linear, corners, direction, displacement_px);
  // About the centre c: x' = c + (I + G)(x - c) + t = (I + G) x + t - G c.
  const cv::Vec2d offset =
      translation - linear * cv::Vec2d(0.5 * (size.width - 1), 0.5 * (size.height - 1));
  return {{1 + linear(0, 0), linear(0, 1), offset[0], linear(1, 0), 1 + linear(1, 1), offset[1]}};
}

double largest_displacement(const AffineMotion& motion, ImageSize size) {
  const double right = size.width - 1;
  const double bottom = size.height - 1;
  return std::max({cv::norm(displacement_at(motion, 0, 0)),
                   cv::norm(displacement_at(motion, right, 0)),
                   cv::norm(displacement_at(motion, 0, bottom)),
                   cv::norm(displacement_at(motion, right, bottom))});
}

std::vector<float> render_affine(const GreyImage& image, const AffineMotion& motion, double u) {
  std::vector<float> still = linear_intensity(image);
  const cv::Mat source(image.size.height, image.size.width, CV_32FC1, still.data());
  std::vector<float> intensity(still.size());
  cv::Mat target(source.size(), source.type(), intensity.data());
  const auto& m = motion.matrix;
  const cv::Matx23d forward(1 + u * (m[0] - 1), u * m[1], u * m[2],  //
                            u * m[3], 1 + u * (m[4] - 1), u * m[5]);
  try {
    cv::warpAffine(source, target, forward, target.size(), cv::INTER_LINEAR,
                   cv::BORDER_REFLECT_101);
  } catch (const cv::Exception&) {
    std::throw_with_nested(std::runtime_error("the affine motion failed in OpenCV"));
  }
  return intensity;
}

AffineInterval::AffineInterval(GreyImage image, const AffineMotion& motion)
    : image_(std::move(image)), motion_(motion) {}

int AffineInterval::steps() const {
  // A drawn displacement of 6 px that rounds to just above 6 is 6 steps, not 7.
  constexpr double kRoundingPx = 1e-9;
  return std::max(
      1, static_cast<int>(std::ceil(largest_displacement(motion_, image_.size) - kRoundingPx)));
}

std::vector<float> AffineInterval::render(int step) const {
  return render_affine(image_, motion_, static_cast<double>(step) / steps());
}

FlowDisplacement AffineInterval::flow() const {
  FlowDisplacement flow{.size = image_.size, .x_px = {}, .y_px = {}};
  flow.x_px.reserve(image_.size.pixel_count());
  flow.y_px.reserve(image_.size.pixel_count());
  for (int y = 0; y < image_.size.height; ++y) {
    for (int x = 0; x < image_.size.width; ++x) {
      const cv::Vec2d displacement = displacement_at(motion_, x, y);
      flow.x_px.push_back(static_cast<float>(displacement[0]));
      flow.y_px.push_back(static_cast<float>(displacement[1]));
    }
  }
  return flow;
}

}  // namespace eventgan
