#pragma once

namespace eventgan {

/// What the process tells its caller (DESIGN section 6); a contract with job schedulers.
enum ExitCode : int {
  kComplete = 0,
  kFailed = 1,
  kUsage = 64,  ///< bad command line or manifest, or a folder of another plan
  kTooManyFaults = 65,
  kInputMissing = 66,
  kStopped = 75  ///< stopped by a signal: run again
};

}  // namespace eventgan
