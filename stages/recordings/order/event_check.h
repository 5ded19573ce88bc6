#pragma once

#include <limits>
#include <stdexcept>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// An event as a file has it, with nothing known about its values.
struct StoredEvent {
  double x = 0;
  double y = 0;
  double t_s = 0;
  double polarity = 0;
};

/// "expected X, got Y"; the caller adds the place.
class EventFault : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws EventFault unless `time_s` is finite and not before `previous_s`.
void check_event_time(double previous_s, double time_s);

/// -1 where a file has it in numbers without a sign of 8, 16 or 32 bits.
constexpr double signed_polarity(double polarity) {
  return polarity == 255 || polarity == 65'535 || polarity == 4'294'967'295 ? -1 : polarity;
}

/// What holds for the events of one stretch of a recording: whole coordinates inside the image,
/// finite times that never decrease, in (after_s, until_s], polarities of {-1, +1} or of {0, 1}; of
/// those -1 as signed_polarity has it, too.
class EventCheck {
 public:
  EventCheck(ImageSize size, double after_s, double until_s)
      : size_(size), last_s_(after_s), until_s_(until_s) {}

  /// The same without bounds of the times.
  static EventCheck of_any_time(ImageSize size) {
    using Limits = std::numeric_limits<double>;
    return {size, -Limits::infinity(), Limits::max()};
  }

  /// The next event of the stretch. Throws EventFault.
  Event take(const StoredEvent& stored);

 private:
  [[noreturn]] void refuse(const StoredEvent& stored) const;

  ImageSize size_;
  double last_s_;
  double until_s_;
  bool first_ = true;
  double off_ = std::numeric_limits<double>::quiet_NaN();  ///< -1 or 0, once one was seen
};

}  // namespace eventgan
