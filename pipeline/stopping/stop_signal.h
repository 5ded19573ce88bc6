#pragma once

#include <csignal>

namespace eventgan {

/// While it lives, SIGINT and SIGTERM ask to stop instead of ending the process; a second one of
/// the same kind ends it as usual. At most one at a time.
class StopSignal {
 public:
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  /// Whether a signal has come. Thread safe.
  bool requested() const;

 private:
  struct sigaction interrupt_before_ {};
  struct sigaction terminate_before_ {};
};

}  // namespace eventgan
