#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "stages/events/realism/realism_scores.h"

namespace eventgan {

/// A volume of the same scene on another grid: each pixel of `to` takes the mean, weighted by area,
/// of the pixels of `from` that it covers, each taken as constant over its square; what lies
/// outside `from` counts as zero. A value of a volume says how many events a pixel has, whatever
/// its size, so the events per pixel of every part of the scene are kept, and with them the events
/// times the area of a pixel; the plain sum grows with the number of pixels.
///
/// `from` and `to` place the same source image. values: [channels, y, x] float32 of size
/// from.volume; the result is of size to.volume, `values` themselves if both placements are equal.
/// Throws std::invalid_argument if the values are not as many, or the sources differ. Thread safe.
std::vector<float> on_grid(std::vector<float> values, int channels, const Placement& from,
                           const Placement& to);

/// Which pixels of a volume matter to a trainer, [y, x], 1 or 0: those whose centre lies in a box
/// that is not to be ignored, or in what a pose trainer may cut out around a person (pose_crop).
/// Pure.
std::vector<std::uint8_t> labelled_pixels(const VolumeLabels& labels, ImageSize size);

/// How far one pair's volume is from the reference's.
struct PairLoss {
  double relative_l2 = 0;  ///< ‖V - R‖ / ‖R‖; infinite if R is empty and V is not
  double largest = 0;      ///< of |V - R|
  double f1_raw = 0;       ///< these three as RealismScores
  double f1_time = 0;
  double time_correlation = 0;
  /// Events of the reference in labelled pixels (a pixel and polarity whose sum over time is above
  /// kEventThreshold), and those of them that the volume does not have.
  std::int64_t labelled_events = 0;
  std::int64_t lost_events = 0;
};

/// volume, reference: [2 bins, y, x] float32, finite and ≥ 0, on one grid; labelled: of
/// labelled_pixels. Throws std::invalid_argument as match_scores. Thread safe.
PairLoss pair_loss(std::span<const float> volume, std::span<const float> reference,
                   const VolumeShape& shape, std::span<const std::uint8_t> labelled);

/// The losses of several pairs together: medians of `relative_l2`, the largest of `largest`, means
/// of the scores (those without meaning left out), sums of events. NaN for no pairs.
PairLoss overall_loss(std::span<const PairLoss> pairs);

/// Share of the labelled events that are lost; NaN if there are none.
double lost_share(const PairLoss& loss);

/// The median, and the middle half of the values: quartiles, between neighbours by rank. NaN for
/// none.
struct Spread {
  double median, low, high;
};
Spread spread_of(std::vector<double> values);

}  // namespace eventgan
