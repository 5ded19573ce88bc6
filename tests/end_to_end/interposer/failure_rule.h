#pragma once

#include <string>

namespace eventgan::interposer {

/// Ways to change a folder, or (kOpen) to read in it.
enum class CallKind {
  kOpen,    ///< an existing file or folder, for reading
  kShut,    ///< of a descriptor that can only read
  kCreate,  ///< a file, or one opened for writing
  kWrite,
  kSync,
  kClose,  ///< of a descriptor that can write
  kTruncate,
  kRename,
  kLink,
  kUnlink,
  kMkdir
};

/// What is to become of a call.
struct Order {
  int error = 0;         ///< nonzero: it fails with this errno
  bool shorten = false;  ///< a write takes half of its bytes
  bool kill = false;     ///< the process is killed after the call
};

/// Whether `path` is the watched folder or below it.
bool is_watched(const std::string& path);

/// Counts a call and writes it to the log; signals or kills the process here and now, or kills it
/// after a time, if the rule says so. Thread safe.
Order announce(CallKind kind, const std::string& path);

/// Ends the process as kill -9 does.
[[noreturn]] void kill_process();

}  // namespace eventgan::interposer
