#pragma once

#include <span>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"

namespace eventgan {

/// Draws events from the numbers that are to be expected: a volume of rates [2 bins, y, x] float32,
/// C order, ≥ 0, becomes, in place, the volume of whole events (event_volume).
///
/// An event camera's pixel adds up what changes and fires each time that this reaches a threshold;
/// how far it is when the frames' interval begins nobody knows. So does this, for each pixel and
/// polarity: from a phase u, uniform in [0, 1), the sum of the rates grows evenly within each bin
/// b, from t* = b - 1/2 to b + 1/2 and not beyond 0 and bins - 1, and there is an event whenever it
/// passes a whole number. The mean number of events in a bin is its rate r; their volume's mean is
/// a little smoother in time, 3/4 r_b + 1/8 (r_{b-1} + r_{b+1}), of even rates the same. Their sum
/// over time is within 1 of the rates' sum, where Poisson counts would scatter by its root. Of more
/// than 64 events in a bin all lie in its middle.
///
/// Phases are stratified, so that sums over neighbours scatter less than those of independent
/// pixels: of each 4x4 pixels one has its phase in each sixteenth of [0, 1), of each 2x2 of these
/// one in each quarter. Polarities and blocks are independent.
///
/// A value that is not finite stays one. Throws std::invalid_argument if the volume does not have
/// its shape's size. Thread safe.
void draw_events(std::span<float> volume, const VolumeShape& shape, const CounterRandom& random);

}  // namespace eventgan
