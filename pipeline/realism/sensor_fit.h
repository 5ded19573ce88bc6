#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/sensor_input.h"
#include "pipeline/realism/still_pixels.h"
#include "stages/events/realism/realism_scores.h"
#include "stages/generator/generator.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// A part of a recording of the camera that is to be fitted.
struct FitPart {
  const Recording* recording = nullptr;
  std::int64_t first_frame = 0;
  std::optional<std::int64_t> last_frame;  ///< none: to the end
};

/// A threshold with which as many events are made as the camera saw, less its noise.
struct FittedThreshold {
  ContrastThreshold threshold;
  Bounds mean;   ///< of the threshold (bootstrap_bounds), wider for `difference` (fit_sensor)
  Bounds ratio;  ///< of its ratio; not told of `difference`, whose ratio is 1
};

/// How many events something made of the pairs that were kept aside.
struct EventRow {
  std::string name;
  double events_per_pixel = 0;
};

/// What was found of a camera.
struct SensorFit {
  std::size_t fitted_pairs = 0;
  std::size_t kept_pairs = 0;                 ///< kept aside, for `rows`
  double grey_level = 0;                      ///< mean of the frames
  std::array<double, 2> grey_levels{};        ///< the middle 80 % of the frames' means
  std::optional<NoiseFit> noise;              ///< none: no pixel is still
  std::optional<FittedThreshold> difference;  ///< of the model `difference`; none: cannot be told
  std::optional<double> difference_anew;      ///< the same of pairs that each begin at level 0
  std::optional<FittedThreshold> network;     ///< through the network that was given
  /// Of the kept pairs, each beginning anew as with convert; the camera's first; empty without any.
  std::vector<EventRow> rows;
  std::vector<std::string> warnings;  ///< what could not be told, and why

  /// Whether "difference" or "network" makes as many events as the camera more nearly with the
  /// fitted threshold than by default, of the kept pairs; none: they do not tell.
  std::optional<bool> is_better(const std::string& method) const;

  /// What goes into a document, rounded to three digits: of thresholds those for convert
  /// (difference_anew) that are not worse than the defaults. `weights`: the network's SHA-256.
  CameraSensor sensor(const std::string& name, const std::string& origin,
                      const std::string& weights = {}) const;
};

/// Fits one camera's noise (fit_noise) and thresholds (fitted_threshold; of the frames' log
/// intensity, kFrameLogEpsilon). A pixel has an event where d = L(t) - L(its last event) reaches
/// C₊ or -C₋. A camera's pixels keep d from pair to pair; from d = 0 at each pair's start small
/// changes would never add up to an event, and too low a threshold be found (by 0 to 60 %). So the
/// model `difference` keeps d over all pairs of a part and the 8 frames before each, as if they
/// were one video, and the first 8 frames (at most a quarter) begin no pair. The threshold's bounds
/// take in what else d could be at the first frame (the video seen backwards before), with a
/// warning where that is more than a tenth, and pixels that are all alike. Which threshold
/// makes as many events from d = 0 is told beside it: of a camera that begins anew with each frame,
/// and of convert's `difference`, which sees pairs alone.
///
/// Fits to the first three quarters of each part's pairs (i, i + gap), and
/// compares on those of the rest that share no time with them. At most 64 pairs of either, spread
/// evenly, but one of each part at least. Noise is of pairs that share no time; the events of hot
/// pixels are left out of all that follows. `network`: one that knows its sensor, or null. The
/// result does not depend on `threads`.
///
/// Throws UsageError as choose_intervals does, InputError as Recording does.
SensorFit fit_sensor(std::span<const FitPart> parts, const Generator* network,
                     const std::vector<int>& gaps, int threads);

/// The fit for people: what was found, how sure it is, and the kept pairs as a table.
std::string to_text(const SensorFit& fit);

/// Of each threshold that was fitted, whether convert is to take it, a line each, with the
/// manifest's `generator`. `document` and `weights`: as the manifest names them.
std::string verdict_text(const SensorFit& fit, const std::string& document,
                         const std::string& weights);

/// How its numbers were found, a sentence for a document's origin. `weights` are the network's.
std::string origin_text(const SensorFit& fit, const std::string& weights);

}  // namespace eventgan
