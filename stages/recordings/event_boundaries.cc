#include <algorithm>

#include "stages/recordings/event_boundaries_internal.h"

namespace eventgan {
namespace {

constexpr std::int64_t kWindow = 1024;

}  // namespace

std::int64_t count_events_until(double time_s, std::int64_t guess, std::int64_t count,
                                const ReadTimes& read_times) {
  // Events before `low` are at or before the time, those from `high` on are after it.
  std::int64_t low = 0;
  std::int64_t high = count;
  std::int64_t middle = std::clamp<std::int64_t>(guess, 0, count);
  while (low < high) {
    const std::int64_t length = std::min(kWindow, high - low);
    const std::int64_t first = std::clamp(middle - length / 2, low, high - length);
    const std::vector<double> times = read_times(first, length);
    if (times.front() > time_s) {
      high = first;
    } else if (times.back() <= time_s) {
      low = first + length;
    } else {
      return first + (std::upper_bound(times.begin(), times.end(), time_s) - times.begin());
    }
    middle = low + (high - low) / 2;
  }
  return low;
}

}  // namespace eventgan
