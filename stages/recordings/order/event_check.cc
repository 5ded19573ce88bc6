#include "stages/recordings/order/event_check.h"

#include <fmt/core.h>

#include <cmath>
#include <string>

namespace eventgan {
namespace {

std::string number(double value) { return fmt::format("{:.17g}", value); }

/// False for NaN as well.
bool is_index(double value, int count) {
  return value >= 0 && value < count && value == std::floor(value);
}

}  // namespace

void check_event_time(double previous_s, double time_s) {
  if (!std::isfinite(time_s)) throw EventFault("expected a finite time, got " + number(time_s));
  if (time_s >= previous_s) return;
  throw EventFault("expected times that never decrease, got " + number(time_s) + " s after " +
                   number(previous_s) + " s");
}

Event EventCheck::take(const StoredEvent& stored) {
  const double polarity = signed_polarity(stored.polarity);
  const bool positive = polarity == 1;
  const bool off = polarity == -1 || polarity == 0;
  const bool in_order = first_ ? stored.t_s > last_s_ : stored.t_s >= last_s_;
  const bool one_convention = !off || std::isnan(off_) || off_ == polarity;
  if (!is_index(stored.x, size_.width) || !is_index(stored.y, size_.height) || !(positive || off) ||
      !one_convention || !in_order || !(stored.t_s <= until_s_)) {
    refuse(stored);
  }
  if (off) off_ = polarity;
  first_ = false;
  last_s_ = stored.t_s;
  return {static_cast<int>(stored.x), static_cast<int>(stored.y), stored.t_s, positive};
}

void EventCheck::refuse(const StoredEvent& stored) const {
  if (!is_index(stored.x, size_.width) || !is_index(stored.y, size_.height)) {
    throw EventFault(fmt::format("expected a pixel of an image of {}, got x = {}, y = {}",
                                 to_string(size_), number(stored.x), number(stored.y)));
  }
  check_event_time(last_s_, stored.t_s);
  if (first_ && stored.t_s == last_s_) {
    throw EventFault("expected a time after " + number(last_s_) + " s, got the same");
  }
  if (stored.t_s > until_s_) {
    throw EventFault("expected times that never decrease, got " + number(stored.t_s) +
                     " s before an event at or before " + number(until_s_) + " s");
  }
  throw EventFault("expected polarities -1 and 1 or 0 and 1, got " + number(stored.polarity) +
                   (std::isnan(off_) ? "" : " after " + number(off_)));
}

}  // namespace eventgan
