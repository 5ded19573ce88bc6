#include "stages/events/images/detail/time_panel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "stages/events/event_volume.h"

namespace eventgan {
namespace {

/// Sum over the bins of one polarity at each pixel.
std::vector<float> mass(std::span<const float> polarity, int bins, std::size_t plane) {
  std::vector<float> sums(plane, 0.0f);
  for (int bin = 0; bin < bins; ++bin) {
    for (std::size_t i = 0; i < plane; ++i) sums[i] += polarity[bin * plane + i];
  }
  return sums;
}

/// `ground`, and over it the colour that `colour_of(pixel, positive, negative)` gives where there
/// are events, the less of the ground the more there are; `unsound` where a value is not finite.
template <class ColourOf>
cv::Mat drawn(std::span<const float> volume, const VolumeShape& shape, const cv::Vec3b& ground,
              const cv::Vec3b& unsound, ColourOf colour_of) {
  const std::size_t plane = shape.size.pixel_count();
  const std::size_t half = shape.bins * plane;
  const std::vector<float> positive = mass(volume.first(half), shape.bins, plane);
  const std::vector<float> negative = mass(volume.subspan(half, half), shape.bins, plane);
  cv::Mat panel(shape.size.height, shape.size.width, CV_8UC3);
  for (std::size_t i = 0; i < plane; ++i) {
    cv::Vec3b& pixel = panel.at<cv::Vec3b>(static_cast<int>(i));
    const float total = positive[i] + negative[i];
    pixel = std::isfinite(total) ? ground : unsound;
    if (!std::isfinite(total) || total <= 0) continue;
    const float strength = 1.0f - std::exp(-total);
    const cv::Vec3b colour = colour_of(i, positive[i], negative[i]);
    for (int channel = 0; channel < 3; ++channel) {
      pixel[channel] = cv::saturate_cast<std::uint8_t>(colour[channel] * strength +
                                                       ground[channel] * (1 - strength));
    }
  }
  return panel;
}

}  // namespace

cv::Vec3b time_colour(float time) {
  static constexpr std::array<std::array<float, 3>, 5> kStops{
      {{255, 60, 40}, {230, 220, 0}, {60, 220, 40}, {0, 220, 255}, {30, 30, 255}}};
  const float at = std::clamp((time - 0.1f) / 0.9f, 0.0f, 1.0f) * (kStops.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const float share = at - static_cast<float>(below);
  cv::Vec3b colour;
  for (int channel = 0; channel < 3; ++channel) {
    colour[channel] = cv::saturate_cast<std::uint8_t>(kStops[below][channel] * (1 - share) +
                                                      kStops[below + 1][channel] * share);
  }
  return colour;
}

cv::Mat time_panel(std::span<const float> volume, const VolumeShape& shape) {
  const TimeImage times = time_image(volume, shape);
  return drawn(volume, shape, {0, 0, 0}, {255, 255, 255},
               [&](std::size_t i, float positive, float negative) {
                 return time_colour((times.positive[i] * positive + times.negative[i] * negative) /
                                    (positive + negative));
               });
}

cv::Mat polarity_panel(std::span<const float> volume, const VolumeShape& shape) {
  return drawn(volume, shape, {255, 255, 255}, {0, 0, 0},
               [](std::size_t, float positive, float negative) {
                 const float share = positive / (positive + negative);
                 return cv::Vec3b(cv::saturate_cast<std::uint8_t>(230 * (1 - share)), 0,
                                  cv::saturate_cast<std::uint8_t>(230 * share));
               });
}

}  // namespace eventgan
