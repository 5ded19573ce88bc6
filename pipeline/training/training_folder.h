#pragma once

#include <filesystem>
#include <string>

#include "pipeline/training/training_checkpoint.h"

namespace eventgan {

/// Where a training writes what (see run_training).
struct TrainingFolder {
  std::filesystem::path root;

  std::filesystem::path checkpoints() const { return root / "checkpoints"; }
  std::filesystem::path losses() const { return root / "training.csv"; }
  std::filesystem::path curves() const { return root / "curves.svg"; }
  std::filesystem::path validation() const { return root / "validation.csv"; }
  std::filesystem::path latest_weights() const { return root / "weights-latest.safetensors"; }
  std::filesystem::path weights() const { return root / "weights.safetensors"; }
  std::filesystem::path lock() const { return root / "training.lock"; }
  std::filesystem::path images() const { return root / "images"; }
  std::filesystem::path image(const TrainingPosition& position) const {
    return images() /
           (std::string(to_string(position.phase)) + "-" + std::to_string(position.step) + ".png");
  }

  /// Makes the folders, and clears away what writers left that are no longer alive. Throws
  /// std::runtime_error if one of them below `root` is a symbolic link (require_no_link).
  void prepare() const;

  /// To be asked before anything is written. Throws UsageError if a person's file has the name of
  /// one that a training writes; and, unless `overwrite`, if results are there without checkpoints:
  /// nothing says then whose weights they are.
  void require_own(bool overwrite) const;

  /// Deletes all of the above that is there; other files are left alone. Throws as `prepare` does,
  /// before anything is deleted.
  void discard() const;
};

/// While it lives, no other training writes to the folder: two would mix their checkpoints and
/// tables. Held by flock on FOLDER/training.lock, so that it ends with the process however that
/// ends; the file stays, and names its last holder. On file systems without flock it holds nobody
/// off.
class TrainingLock {
 public:
  /// Makes the folder if it is not there. Throws std::runtime_error naming the holder if there is
  /// one, or the file if it cannot be made or is a symbolic link.
  explicit TrainingLock(const std::filesystem::path& folder);
  ~TrainingLock();
  TrainingLock(const TrainingLock&) = delete;
  TrainingLock& operator=(const TrainingLock&) = delete;

 private:
  int descriptor_;
};

}  // namespace eventgan
