#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// A voxel, or a sum of voxels, above this counts as an event (V2CE, Zhang et al. 2024).
inline constexpr float kEventThreshold = 0.01f;

/// How one volume compares with the real one of the same frames, both normalised, V̂ = min(V,
/// η98) / η98. F1 after V2CE: of what is an event, above kEventThreshold. NaN where a score has no
/// meaning (a correlation with a constant), 1 for the F1 of two empty volumes.
struct RealismScores {
  double f1_raw = 0;            ///< voxel by voxel
  double f1_time = 0;           ///< summed over time, per polarity
  double f1_time_polarity = 0;  ///< summed over time and polarity
  double pool_mse_2 = 0;        ///< mean squared difference after 2x2 mean pooling in y and x
  double pool_mse_4 = 0;  ///< after 4x4; an incomplete border block is the mean of what it has
  double time_correlation = 0;  ///< Pearson, of the average-timestamp images (both polarities
                                ///< side by side) over all pixels; T is 0 where there is no event,
                                ///< a sum over time of at most 0.01. (Over the pixels with events
                                ///< alone an empty or a random volume would do better than one that
                                ///< has most events right, since the misses correlate negatively.)
  double polarity_correlation = 0;  ///< Pearson, of (Σ positive - Σ negative) with the change of
                                    ///< log intensity ln((next + 1)/(previous + 1)), u in 0..255
  double events_per_pixel = 0;      ///< Σ V̂ / (H W)
  double positive_share = 0;        ///< Σ positive / Σ both; NaN if empty
  std::vector<double> events_per_channel;  ///< Σ V̂ per time bin / (H W), positive ones first

  /// Both polarities.
  std::vector<double> events_per_bin() const;
};

/// Σ over the channels of |share of the events - share of the real events|, 0..2: how differently
/// two cameras spread their events over time and polarity. NaN where either has none. Throws
/// std::invalid_argument if the numbers of channels differ.
double share_distance(const RealismScores& scores, const RealismScores& real);

/// volume, real: [2 bins, y, x] float32, C order, ≥ 0, dimensionless; what is above 1 counts as 1.
/// Counts of events are to be divided by their η98 first; a generator trained on such volumes gives
/// V̂ itself, and dividing it once more would make the faintest of its volumes full of events.
/// previous, next: the pair's frames. Throws
/// std::invalid_argument if sizes differ, there is no pixel or no bin, or a value is NaN, infinite
/// or below zero. Thread safe.
RealismScores realism_scores(std::span<const float> volume, std::span<const float> real,
                             const VolumeShape& shape, const GreyImage& previous,
                             const GreyImage& next);

/// The events a pixel: Σ over time of min(V, 1), [polarity, y, x] float32, positive first. For a
/// volume as realism_scores takes it; throws std::invalid_argument as it does. Thread safe.
std::vector<float> events_over_time(std::span<const float> volume, const VolumeShape& shape);

/// The three F1 and `time_correlation` of realism_scores, which compare two volumes without their
/// frames; all other fields are NaN. Throws as realism_scores does. Thread safe.
RealismScores match_scores(std::span<const float> volume, std::span<const float> real,
                           const VolumeShape& shape);

/// Means over pairs, field by field; a NaN is left out of its mean (all NaN, or no pairs: NaN).
/// Throws std::invalid_argument if the numbers of bins differ. Thread safe.
RealismScores mean_scores(std::span<const RealismScores> scores);

/// At a share 0..1 between the least and the most of sorted numbers, by rank and on a line between
/// neighbours; NaN of none. Thread safe.
double quantile(std::span<const double> sorted, double share);

/// Where a number lies with a probability of 95 %. NaN: it cannot be told.
struct Bounds {
  double low = std::numeric_limits<double>::quiet_NaN();
  double high = std::numeric_limits<double>::quiet_NaN();
};

/// How sure `statistic` of `pairs` pairs is: the percentile bootstrap (Efron 1979). The pairs are
/// drawn again a thousand times, as many as there are, with repetition; `statistic` gets the
/// indices of a draw; the bounds are the middle 95 % of what it gives, NaN left out. Not told for
/// fewer than three pairs. Always the same draws, so that methods are compared on the same ones.
/// Neighbouring pairs of a recording are alike, so the truth is less sure than this.
Bounds bootstrap_bounds(std::size_t pairs,
                        const std::function<double(std::span<const std::size_t>)>& statistic);

/// Bounds of mean_scores, field by field.
struct ScoreBounds {
  RealismScores low, high;
};
ScoreBounds mean_bounds(std::span<const RealismScores> scores);

}  // namespace eventgan
