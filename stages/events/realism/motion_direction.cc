#include "stages/events/realism/motion_direction.h"

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/events/realism/detail/motion_direction.h"
#include "stages/events/volume_statistics.h"

namespace eventgan {
namespace {

/// An image's value beside (x, y), if there is a pixel with events.
std::optional<double> event_time(const cv::Mat1d& time, const cv::Mat1b& event, int y, int x) {
  if (y < 0 || x < 0 || y >= event.rows || x >= event.cols || event(y, x) == 0) return {};
  return time(y, x);
}

std::optional<double> difference(std::optional<double> before, double here,
                                 std::optional<double> after) {
  if (before && after) return (*after - *before) / 2;
  if (after) return *after - here;
  if (before) return here - *before;
  return {};
}

}  // namespace

TimeSlope time_slope(std::span<const float> volume, const VolumeShape& shape, double min_events) {
  const int rows = shape.size.height;
  const int columns = shape.size.width;
  cv::Mat1d mass(rows, columns, 0.0);
  cv::Mat1d time(rows, columns, 0.0);
  for (int channel = 0; channel < shape.channels(); ++channel) {
    const int bin = channel % shape.bins;
    const double tau = shape.bins > 1 ? static_cast<double>(bin) / (shape.bins - 1) : 0.0;
    const float* values =
        volume.data() + static_cast<std::size_t>(channel) * shape.size.pixel_count();
    for (int i = 0; i < rows * columns; ++i) {
      mass(i) += static_cast<double>(values[i]);
      time(i) += tau * static_cast<double>(values[i]);
    }
  }
  time /= mass;  // not looked at where there is no mass

  TimeSlope slope{cv::Mat1b((mass >= min_events) & (mass > 0)), cv::Mat1b(rows, columns, uchar{0}),
                  cv::Mat1d(rows, columns, 0.0), cv::Mat1d(rows, columns, 0.0)};
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      if (slope.event(y, x) == 0) continue;
      const double here = time(y, x);
      const auto along_x = difference(event_time(time, slope.event, y, x - 1), here,
                                      event_time(time, slope.event, y, x + 1));
      const auto along_y = difference(event_time(time, slope.event, y - 1, x), here,
                                      event_time(time, slope.event, y + 1, x));
      if (!along_x || !along_y) continue;
      slope.known(y, x) = 255;
      slope.x(y, x) = *along_x;
      slope.y(y, x) = *along_y;
    }
  }
  return slope;
}

namespace {

void check_arguments(std::span<const float> volume, const VolumeShape& shape,
                     std::span<const float> flow_x, std::span<const float> flow_y,
                     const DirectionSettings& settings) {
  const std::size_t plane = shape.size.pixel_count();
  if (shape.bins < 1 || plane == 0 || volume.size() != shape.value_count() ||
      flow_x.size() != plane || flow_y.size() != plane) {
    throw std::invalid_argument(
        "expected a volume [" + std::to_string(shape.channels()) + ", H, W] and flows of " +
        to_string(shape.size) + " pixels, got " + std::to_string(volume.size()) + ", " +
        std::to_string(flow_x.size()) + " and " + std::to_string(flow_y.size()) + " values");
  }
  if (settings.window < 1 || settings.window % 2 == 0) {
    throw std::invalid_argument("expected an odd window, got " + std::to_string(settings.window));
  }
  if (const std::size_t bad = first_unsound_value(volume); bad != volume.size()) {
    throw std::invalid_argument("expected finite values >= 0, got " + std::to_string(volume[bad]));
  }
}

/// Sums over the window around each pixel, as far as it lies in the image.
cv::Mat1d window_sums(const cv::Mat& values, int window) {
  cv::Mat1d sums;
  cv::boxFilter(values, sums, CV_64F, {window, window}, {-1, -1}, /*normalize=*/false,
                cv::BORDER_CONSTANT);
  return sums;
}

/// The normal equations of Σ w (∇T · v - 1)² at each pixel: G v = s.
struct NormalEquations {
  cv::Mat1d xx, xy, yy;  ///< G = Σ w ∇T ∇Tᵀ
  cv::Mat1d x, y;        ///< s = Σ w ∇T
  cv::Mat1d count;       ///< number of ∇T
};

/// A contour that moves so fast, px over the pair, has no slope that could be told from rounding.
constexpr double kFastestPx = 1000;

NormalEquations normal_equations(const TimeSlope& slope, int window) {
  const cv::Size size = slope.known.size();
  cv::Mat1d used(size, 0.0), unit_x(size, 0.0), unit_y(size, 0.0);
  for (int i = 0; i < static_cast<int>(slope.known.total()); ++i) {
    const double steepness = std::hypot(slope.x(i), slope.y(i));
    if (slope.known(i) == 0 || steepness * kFastestPx < 1) continue;
    used(i) = 1;
    unit_x(i) = slope.x(i) / steepness;
    unit_y(i) = slope.y(i) / steepness;
  }
  // w = 1/|∇T|, so w ∇T ∇Tᵀ is the unit vectors' product times |∇T|, and w ∇T the unit vector.
  return {window_sums(unit_x.mul(slope.x), window),
          window_sums(unit_x.mul(slope.y), window),
          window_sums(unit_y.mul(slope.y), window),
          window_sums(unit_x, window),
          window_sums(unit_y, window),
          window_sums(used, window)};
}

struct Direction {
  double x = 0;
  double y = 0;
  double length() const { return std::hypot(x, y); }
};

/// The fitted flow, or zero if the window does not determine it.
Direction fitted_flow(const NormalEquations& sums, int y, int x,
                      const DirectionSettings& settings) {
  if (sums.count(y, x) < settings.min_slopes) return {};
  const double xx = sums.xx(y, x);
  const double xy = sums.xy(y, x);
  const double yy = sums.yy(y, x);
  const double middle = (xx + yy) / 2;
  const double radius = std::hypot((xx - yy) / 2, xy);
  if (middle - radius < settings.min_roundness * (middle + radius)) return {};
  const double determinant = xx * yy - xy * xy;
  return {(yy * sums.x(y, x) - xy * sums.y(y, x)) / determinant,
          (xx * sums.y(y, x) - xy * sums.x(y, x)) / determinant};
}

}  // namespace

DirectionScore motion_direction(std::span<const float> volume, const VolumeShape& shape,
                                std::span<const float> flow_x, std::span<const float> flow_y,
                                const DirectionSettings& settings) {
  check_arguments(volume, shape, flow_x, flow_y, settings);
  const TimeSlope slope = time_slope(volume, shape, settings.min_events);
  const NormalEquations sums = normal_equations(slope, settings.window);
  const double least_cosine = std::cos(settings.tolerance_deg * std::numbers::pi / 180);

  DirectionScore score;
  for (int y = 0; y < shape.size.height; ++y) {
    for (int x = 0; x < shape.size.width; ++x) {
      const std::size_t at =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(shape.size.width) +
          static_cast<std::size_t>(x);
      const Direction truth{static_cast<double>(flow_x[at]), static_cast<double>(flow_y[at])};
      if (slope.event(y, x) == 0 || !std::isfinite(truth.length()) ||
          truth.length() < settings.min_flow_px) {
        continue;
      }
      const Direction flow = fitted_flow(sums, y, x, settings);
      if (flow.length() == 0) continue;
      ++score.pixels;
      const double cosine =
          (flow.x * truth.x + flow.y * truth.y) / (flow.length() * truth.length());
      score.within += cosine >= least_cosine;
    }
  }
  return score;
}

}  // namespace eventgan
