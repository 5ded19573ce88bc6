#pragma once

#include <filesystem>

namespace eventgan {

/// While it lives, nobody else holds a lock on the same file or folder. Held by flock, so that it
/// leaves no file, and ends with the process however that ends. Where the file system has no flock
/// for what is only read (NFS) it holds nobody off. Thread safety: one thread at a time.
class FileLock {
 public:
  enum class IfTaken { kWait, kGiveUp };

  /// Locks a file or folder that exists. Throws std::system_error naming it if it cannot be opened.
  FileLock(const std::filesystem::path& path, IfTaken if_taken);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  /// Whether somebody else holds it, with kGiveUp.
  bool is_taken() const { return is_taken_; }

 private:
  int descriptor_;
  bool is_taken_ = false;
};

}  // namespace eventgan
