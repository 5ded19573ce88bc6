#pragma once

#include <mutex>

namespace eventgan {

/// The right to call HDF5, for a scope: all recordings of the process share one, since not every
/// build of HDF5 is safe for threads. Also keeps HDF5 from printing its errors in this thread.
/// Handles must be closed within a turn, too.
class Hdf5Turn {
 public:
  Hdf5Turn();

 private:
  std::lock_guard<std::mutex> lock_;
};

}  // namespace eventgan
