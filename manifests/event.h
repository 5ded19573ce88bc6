#pragma once

namespace eventgan {

/// One event of a recording.
struct Event {
  int x = 0;  ///< column, 0-based
  int y = 0;  ///< row, 0-based
  double t_s = 0;
  bool positive = true;
  bool operator==(const Event&) const = default;
};

}  // namespace eventgan
