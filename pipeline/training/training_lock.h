#pragma once

#include <filesystem>

namespace eventgan {

/// While it lives, no other training writes to the folder: two would mix their checkpoints and
/// tables. Held by flock on FOLDER/training.lock, so that it ends with the process however that
/// ends; the file stays, and names its last holder. On file systems without flock it holds nobody
/// off.
class TrainingLock {
 public:
  /// Makes the folder if it is not there. Throws std::runtime_error naming the holder if there is
  /// one, or the file if it cannot be made.
  explicit TrainingLock(const std::filesystem::path& folder);
  ~TrainingLock();
  TrainingLock(const TrainingLock&) = delete;
  TrainingLock& operator=(const TrainingLock&) = delete;

 private:
  int descriptor_;
};

}  // namespace eventgan
