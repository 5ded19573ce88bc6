#pragma once

#include <filesystem>
#include <memory>

#include "stages/hdf5/hdf5_handle_internal.h"

namespace eventgan {

/// A new HDF5 file, opened for writing through a file driver of our own.
///
/// Why: once a write has failed (disk full), HDF5 1.10 can neither close the file nor forget it,
/// and crashes when the program ends. This driver remembers the first error, drops what is written
/// after it and tells HDF5 that all is well, so the file can always be closed. So after any HDF5
/// call `check` must be asked before its result is believed. The file is an ordinary one.
///
/// It also takes no file locks, which many cluster file systems do not have: the name is ours
/// alone.
class Hdf5OutputFile {
 public:
  /// Creates `path`, which must not exist, with creation properties `creation`. Throws
  /// std::runtime_error naming the path.
  Hdf5OutputFile(const std::filesystem::path& path, hid_t creation);
  ~Hdf5OutputFile();

  hid_t id() const { return file_; }

  /// Throws std::runtime_error "cannot write PATH: REASON" if any write has failed so far.
  void check() const;

  /// Closes the file, which fails if any object in it is still open; then `check`.
  void close();

 private:
  std::filesystem::path path_;
  std::unique_ptr<int>
      error_;  ///< errno of the first failed write, or 0; the driver holds its address
  Hdf5Handle file_;
};

}  // namespace eventgan
