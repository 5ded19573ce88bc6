#pragma once

#include <exception>
#include <string>

namespace eventgan {

/// What the process tells its caller; a contract with job schedulers.
enum ExitCode : int {
  kComplete = 0,
  kFailed = 1,
  kUsage = 64,  ///< bad command line or manifest, or a folder of another plan
  kTooManyFaults = 65,
  kInputMissing = 66,
  kStopped = 75  ///< stopped by a signal: run again
};

/// Thrown where only another of the programs goes on: main() then runs that with the same
/// arguments. No std::exception, so that nobody on the way takes it for a failure.
struct HandOver {
  const char* program;  ///< "eventgan-torch"
  const char* advice;   ///< what to do where it is missing
};

/// The message of an exception and of those nested in it, outermost first, one per line and
/// indented.
std::string error_text(const std::exception& error);

/// The same as one line, for lists with a line a fault.
std::string error_line(const std::exception& error);

/// The exit code that stands for an exception: UsageError 64, TooManyFaults 65, InputError 66,
/// Stopped 75, else 1.
int exit_code_of(const std::exception& error);

}  // namespace eventgan
