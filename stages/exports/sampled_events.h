#pragma once

#include <span>
#include <string>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"

namespace eventgan {

/// Of one volume: 10^9, some 50 GB. Generated volumes and those of a second of any camera are far
/// below.
inline constexpr double kMostSampledEvents = 1e9;

/// How many events a value of a volume becomes.
enum class EventCounts {
  kPoisson,  ///< a draw from Poisson's distribution, the value its mean
  kRounded   ///< the nearest whole number
};

/// Events of which `volume` [2 bins, H, W] float32, finite and >= 0, could have been made, in time
/// order, from 0 to `duration_s`: value V of bin b becomes a count of events, drawn by `random` and
/// the value's place alone.
///
/// They lie at the bin's time b/(bins-1) duration_s, but wherever a pixel has events of one
/// polarity in two neighbouring bins, these are taken in pairs and moved towards each other by the
/// same share u of the bins' distance, drawn with the density 2 (1 - u) of the volume's linear
/// kernel. What the one gives to the other's bin it gets back, so that event_volume of the events
/// has exactly the counts (but for rounding), whatever u was: with kRounded |V' - V| <= 0.5, with
/// kPoisson V' has mean V and variance V. For event_volume, which counts time from the first event
/// to the last, one pixel's events each of the first and of the last bin stay where they are; if
/// a volume has no events in one of these bins, event_volume stretches what is left.
///
/// Throws UsageError for values that make more than kMostSampledEvents altogether. Thread safe.
std::vector<Event> sample_events(std::span<const float> volume, const VolumeShape& shape,
                                 double duration_s, EventCounts counts,
                                 const CounterRandom& random);

/// The events as text: a line "t x y p" each, t in seconds with 9 decimals, p 0 or 1.
std::string events_text(std::span<const Event> events);

}  // namespace eventgan
