#pragma once

#include <filesystem>
#include <memory>

#include "manifests/files/atomic_file.h"
#include "stages/base/hdf5/hdf5.h"

namespace eventgan {

/// A new HDF5 file on its way to its name (atomic_file.h), opened for writing through a file driver
/// of our own, without time stamps.
///
/// Why: once a write has failed (disk full), HDF5 1.10 can neither close the file nor forget it,
/// and crashes when the program ends. This driver remembers the first error, drops what is written
/// after it and tells HDF5 that all is well, so the file can always be closed. So no HDF5 call's
/// result is to be believed before `check`, which `write` and `close` do. The file is an ordinary
/// one.
///
/// It also takes no file locks, which many cluster file systems do not have: the name is ours
/// alone.
class Hdf5OutputFile {
 public:
  /// Creates the temporary beside `target`. Throws std::runtime_error naming the path.
  explicit Hdf5OutputFile(const std::filesystem::path& target);

  hid_t id() const { return file_; }

  /// The file as bytes; to be published once it is closed.
  AtomicFile& output() { return output_; }
  const std::filesystem::path& target() const { return output_.target(); }

  /// Runs `work`, which calls HDF5, under the lock. Throws what it throws, but std::runtime_error
  /// "cannot write PATH: REASON" if any write has failed so far: a full disk explains more than
  /// what HDF5 makes of it.
  template <class Work>
  void write(Work&& work) {
    const Hdf5Lock lock;
    try {
      work();
    } catch (const Hdf5Error&) {
      check();
      throw;
    }
    check();
  }

  /// Closes the file, which fails if any object in it is still open. Within `write`.
  void close() { file_.close(output_.temporary().string()); }

 private:
  void check() const;

  AtomicFile output_;  ///< first, so that the file is closed when it is removed
  std::unique_ptr<int>
      error_;  ///< errno of the first failed write, or 0; the driver holds its address
  Hdf5Handle file_;
};

}  // namespace eventgan
