#include "stages/events/simulation/affine_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

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

namespace {

// OpenCV's fixed point: places are summed in 1/1024 px and rounded to 1/32 px.
constexpr int kPlaceBits = 10;
constexpr int kPartBits = 5;
constexpr int kParts = 1 << kPartBits;

using Four = std::array<float, 4>;

/// Weights of the four pixels around a place by its part of a pixel: [32 y + x].
struct Weights {
  std::array<Four, kParts * kParts> of;
};

constexpr Weights bilinear_weights() {
  Weights weights{};
  for (int i = 0; i < kParts * kParts; ++i) {
    const float y = static_cast<float>(i / kParts) / kParts;
    const float x = static_cast<float>(i % kParts) / kParts;
    weights.of[static_cast<std::size_t>(i)] = {(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x};
  }
  return weights;
}

constexpr Weights kWeights = bilinear_weights();

float blend(const Four& weights, const Four& values) {
  return values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2] +
         values[3] * weights[3];
}

int to_place(double px) { return cv::saturate_cast<int>(px * (1 << kPlaceBits)); }

}  // namespace

AffinePlaces::AffinePlaces(ImageSize size, const AffineMotion& motion, double u) : size_(size) {
  const auto& m = motion.matrix;
  const std::array<double, 6> forward = {1 + u * (m[0] - 1), u * m[1],           u * m[2],
                                         u * m[3],           1 + u * (m[4] - 1), u * m[5]};
  const double determinant = forward[0] * forward[4] - forward[1] * forward[3];
  const double scale = determinant != 0 ? 1 / determinant : 0;
  const double xx = forward[4] * scale;
  const double xy = forward[1] * -scale;
  const double yx = forward[3] * -scale;
  const double yy = forward[0] * scale;
  inverse_ = {xx, xy, -xx * forward[2] - xy * forward[5],
              yx, yy, -yx * forward[2] - yy * forward[5]};
  for (int x = 0; x < size.width; ++x) {
    column_x_.push_back(to_place(xx * x));
    column_y_.push_back(to_place(yx * x));
  }
}

void AffinePlaces::row(std::span<const float> still, int y, std::span<float> intensity) const {
  constexpr int kShift = kPlaceBits - kPartBits;
  constexpr int kHalfPart = 1 << (kShift - 1);
  const int row_x = to_place(inverse_[1] * y + inverse_[2]) + kHalfPart;
  const int row_y = to_place(inverse_[4] * y + inverse_[5]) + kHalfPart;
  const auto width = static_cast<std::size_t>(size_.width);
  const auto right = static_cast<unsigned>(size_.width - 1);
  const auto bottom = static_cast<unsigned>(size_.height - 1);
  for (std::size_t i = 0; i < intensity.size(); ++i) {
    const int place_x = (row_x + column_x_[i]) >> kShift;
    const int place_y = (row_y + column_y_[i]) >> kShift;
    const int from_x = place_x >> kPartBits;
    const int from_y = place_y >> kPartBits;
    const Four& weights = kWeights.of[static_cast<std::size_t>((place_y & (kParts - 1)) * kParts +
                                                               (place_x & (kParts - 1)))];
    if (static_cast<unsigned>(from_x) < right && static_cast<unsigned>(from_y) < bottom) {
      const float* from = still.data() + static_cast<std::size_t>(from_y) * width + from_x;
      intensity[i] = blend(weights, {from[0], from[1], from[width], from[width + 1]});
    } else {
      const auto at = [&](int at_y, int at_x) {
        const int inside_y = cv::borderInterpolate(at_y, size_.height, cv::BORDER_REFLECT_101);
        const int inside_x = cv::borderInterpolate(at_x, size_.width, cv::BORDER_REFLECT_101);
        return still[static_cast<std::size_t>(inside_y) * width +
                     static_cast<std::size_t>(inside_x)];
      };
      intensity[i] = blend(weights, {at(from_y, from_x), at(from_y, from_x + 1),
                                     at(from_y + 1, from_x), at(from_y + 1, from_x + 1)});
    }
  }
}

std::vector<float> AffinePlaces::image(std::span<const float> still) const {
  const auto width = static_cast<std::size_t>(size_.width);
  std::vector<float> intensity(still.size());
  for (int y = 0; y < size_.height; ++y) {
    row(still, y, std::span(intensity).subspan(static_cast<std::size_t>(y) * width, width));
  }
  return intensity;
}

std::vector<float> render_affine(const GreyImage& image, const AffineMotion& motion, double u) {
  const std::vector<float> still = linear_intensity(image);
  return AffinePlaces(image.size, motion, u).image(still);
}

AffineInterval::AffineInterval(const GreyImage& image, const AffineMotion& motion)
    : still_(linear_intensity(image)) {
  // A drawn displacement of 6 px that rounds to just above 6 is 6 steps, not 7.
  constexpr double kRoundingPx = 1e-9;
  const int steps = std::max(
      1, static_cast<int>(std::ceil(largest_displacement(motion, image.size) - kRoundingPx)));
  for (int step = 0; step <= steps; ++step) {
    places_.emplace_back(image.size, motion, static_cast<double>(step) / steps);
  }
}

void AffineInterval::render_row(int step, int y, std::span<float> intensity) const {
  if (step == 0) {
    const auto first = static_cast<std::size_t>(y) * intensity.size();
    std::ranges::copy(std::span(still_).subspan(first, intensity.size()), intensity.begin());
    return;
  }
  places_[static_cast<std::size_t>(step)].row(still_, y, intensity);
}

}  // namespace eventgan
