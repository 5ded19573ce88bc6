#pragma once

#include <array>
#include <csignal>
#include <optional>

namespace eventgan {

/// While it lives, SIGINT, SIGTERM and SIGUSR1 (what schedulers send ahead of a time limit) ask to
/// stop instead of ending the process. A second SIGINT ends it at once; further SIGTERM and SIGUSR1
/// change nothing, since schedulers repeat them. At most one at a time.
class StopSignal {
 public:
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  /// Whether a signal has come. Thread safe.
  bool requested() const;

  /// Seconds since the first one; none if none has come. Thread safe.
  std::optional<double> seconds_since_request() const;

 private:
  std::array<struct sigaction, 3> before_{};
};

}  // namespace eventgan
