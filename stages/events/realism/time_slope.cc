#include <optional>

#include "stages/events/realism/time_slope_internal.h"

namespace eventgan {
namespace {

/// A picture's value beside (x, y), if there is a pixel with events.
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

}  // namespace eventgan
