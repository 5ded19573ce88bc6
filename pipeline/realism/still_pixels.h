#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// A pixel is still between two frames if its own grey level and the mean over the 5x5 pixels
/// around it (those inside the image) of how much each one's level changes differ by at most so
/// much, and neither of its levels is clipped (0 or 255), beyond which no change shows.
inline constexpr double kStillLevels = 2;

/// What the pixels of a pair that are still saw: noise.
struct StillPixels {
  double duration_s = 0;
  std::vector<std::uint8_t> still;      ///< [y, x], 0 or 1
  std::vector<std::uint32_t> positive;  ///< of each positive event of a still pixel y * width + x
  std::vector<std::uint32_t> negative;
};

/// Of frames of one size and the events between them. Thread safe.
StillPixels find_still_pixels(const GreyImage& previous, const GreyImage& next,
                              std::span<const Event> events, double duration_s);

/// A camera's noise, and what it was found from.
struct NoiseFit {
  NoiseSpec noise;
  double positive_hz = 0;  ///< of a pixel that is not hot, over all pairs
  double negative_hz = 0;
  double pixel_seconds = 0;  ///< that pixels which are not hot were still, summed over them
  std::size_t pixels = 0;    ///< that were still in a pair, hot ones too
  std::size_t hot_pixels = 0;
  std::size_t pairs = 0;                       ///< that have 100 still pixels, others are left out
  std::vector<std::vector<std::uint8_t>> hot;  ///< of each recording, [y, x], 1: hot; empty if it
                                               ///< has no pairs
};

/// The noise of pairs of one camera's recordings, each one's pairs of one size. With r the rate of
/// a polarity of pixels that are not hot, shot_hz = 2 min(r₊, r₋) and leak_hz = max(0, r₊ - r₋)
/// (add_noise): each the number of all pairs together, or the range of the middle 80 % of the pairs
/// if there are ten whose pixels are expected to have 400 events at that number, which tells a
/// rate to 5 %: of fewer events the range would be chance. A pixel may be hot if it has 5 events or
/// more while it is still, and more than 5 a second. It is if it also has more than 20 times the
/// rate of its recording's others: the median of those that have events but too few to be hot,
/// and the mean of all still pixels but for the most active hundredth, in light that flickers.
/// None if no pair has 100 still pixels. Thread safe.
std::optional<NoiseFit> fit_noise(std::span<const std::vector<StillPixels>> recordings);

}  // namespace eventgan
