#pragma once

#include <string>

#include "stages/recordings/readers/detail/event_parts.h"

namespace eventgan {

/// What the times of events count, of which nothing but the times tells it.
struct TimeUnit {
  double ticks_per_s = 1e6;
  std::string found;  ///< "microseconds: 0.04 s, 2,000 events, ..."; empty: there is no time
};

/// `events` have their times as they are stored. A unit is taken where no other makes a recording
/// of them: by how many events a pixel then has in a second, how long they last, the step of the
/// times, and how soon a pixel has its next event. Throws InputError with all readings where two
/// may be.
TimeUnit tell_time_unit(const CompactEvents& events, const std::string& file);

}  // namespace eventgan
