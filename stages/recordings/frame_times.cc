#include <cmath>
#include <cstddef>

#include "manifests/faults.h"
#include "stages/recordings/frame_times_internal.h"

namespace eventgan {

void check_frame_times(const std::vector<double>& times_s, const std::string& place) {
  if (times_s.empty()) throw InputError("expected at least one frame, got none, in " + place);
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const std::string at = ", in " + place + " (frame " + std::to_string(i) + ")";
    if (!std::isfinite(times_s[i])) {
      throw InputError("expected a finite time, got " + std::to_string(times_s[i]) + at);
    }
    if (i > 0 && times_s[i] <= times_s[i - 1]) {
      throw InputError("expected a time after " + std::to_string(times_s[i - 1]) + " s, got " +
                       std::to_string(times_s[i]) + " s" + at);
    }
  }
}

}  // namespace eventgan
