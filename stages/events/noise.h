#pragma once

#include <span>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"

namespace eventgan {

/// Rates of hot pixels: each pixel's is drawn log-uniformly from these.
inline constexpr double kLeastHotPixel_hz = 5;
inline constexpr double kMostHotPixel_hz = 100;

/// What the noise of a pair is drawn by.
struct NoiseRandom {
  CounterRandom camera;  ///< of all pairs of one camera: which pixels are hot
  CounterRandom pair;
};

/// Adds noise events to a volume [2 bins, y, x] float32, C order: +1 each, in one voxel. Numbers
/// of the spec are drawn for the pair. Events of a pixel are a Poisson process over `duration_s`,
/// finite, >= 0; at the time t, uniform in it, an event is in bin round((bins - 1) t / duration_s),
/// so that the first and the last bin have half of the others' share. Rates by polarity:
///
///   positive  shot_hz / 2 + leak_hz,   negative  shot_hz / 2,
///
/// and a hot pixel's own at its own polarity. Which pixels are hot, at which rate and polarity,
/// follows from random.camera and the volume's size; those of a smaller share are among those of a
/// larger one. Volumes to be letterboxed are given without their borders.
///
/// A uniform voxel is drawn for each event, or where there would be many in a voxel their number is
/// drawn for each: the time is bounded by the volume's size, whatever the rates. Returns the number
/// of events. Throws std::invalid_argument if the volume does not have its shape's size. Thread
/// safe.
double add_noise(const NoiseSpec& spec, double duration_s, const VolumeShape& shape,
                 const NoiseRandom& random, std::span<float> volume);

}  // namespace eventgan
