#pragma once

#include <span>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"

namespace eventgan {

/// Puts whole events in the place of the numbers that are to be expected: a volume of rates [2
/// bins, y, x] float32, C order, ≥ 0, becomes one of counts, in place.
///
/// An event camera's pixel adds up what changes and fires each time that this reaches a threshold;
/// how far it is when the frames' interval begins nobody knows. So does this, for each pixel and
/// polarity: with a phase u, uniform in [0, 1), and the sum of rates Λ_b up to and with bin b,
///
///   n_b = floor(u + Λ_b) - floor(u + Λ_(b-1)),  Λ_(-1) = 0.
///
/// The mean of n_b is the rate. The sum over time is within 1 of the sum of rates, where Poisson
/// counts would scatter by its root. Polarities and pixels are independent. A value that is not
/// finite stays one. `random` numbers: 2 y x. Throws std::invalid_argument if the volume does not
/// have its shape's size. Thread safe.
void draw_events(std::span<float> volume, const VolumeShape& shape, const CounterRandom& random);

}  // namespace eventgan
