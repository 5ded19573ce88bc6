#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/archives/pickle.h"

namespace eventgan {

// What reading a checkpoint may take, so that a hostile file cannot ask for more: twice the file's
// size, and an allowance that does not depend on the file.
//
//   while the pickle is read:  its bytes (≤ the file) + its values (≤ the file + allowance)
//   while tensors are made:    its values + the tensors + one storage ≤ 2 x the file + allowance
//
// A zip file's list of members (zip_archive.h) comes on top, up to 32 MiB.

constexpr std::uint64_t kCheckpointAllowance = std::uint64_t{32} << 20;

constexpr std::uint64_t most_checkpoint_memory(std::uint64_t file_size) {
  return 2 * file_size + kCheckpointAllowance;
}

/// A pickle has about a hundred bytes for a tensor and a few for a number of a counter or a list;
/// 64 MiB are more than any network needs. (A compressed one may be a little larger than its file.)
constexpr std::uint64_t most_pickle_bytes(std::uint64_t file_size) {
  return std::min(file_size + (std::uint64_t{1} << 20), std::uint64_t{64} << 20);
}

constexpr std::uint64_t most_pickle_memory(std::uint64_t file_size) {
  return file_size + kCheckpointAllowance;
}

/// Memory that is still to be had; nothing is made before it was taken from here.
class CheckpointMemory {
 public:
  explicit CheckpointMemory(std::uint64_t bytes) : left_(bytes) {}

  std::uint64_t left() const { return left_; }

  /// Throws std::runtime_error where less is left.
  void take(std::uint64_t bytes) {
    if (bytes > left_) {
      throw std::runtime_error(
          "expected values and tensors that take at most twice the file's size, got more");
    }
    left_ -= bytes;
  }

 private:
  std::uint64_t left_;
};

/// An opened PyTorch checkpoint: a pickle, and the storages (flat arrays of numbers) it names.
class CheckpointArchive {
 public:
  virtual ~CheckpointArchive() = default;

  virtual const PickleDocument& document() const = 0;

  /// The storage's bytes, little endian. Throws std::runtime_error if there is none of that key, or
  /// it has more than `most_bytes`.
  virtual std::vector<std::byte> storage(const std::string& key,
                                         std::uint64_t most_bytes) const = 0;
};

/// Opens a checkpoint of PyTorch 1.6 or later: a zip file with NAME/data.pkl and the storages
/// NAME/data/KEY. Memory as most_checkpoint_memory. Throws std::runtime_error naming the file.
std::unique_ptr<CheckpointArchive> open_zip_checkpoint(const std::filesystem::path& file);

/// Opens a checkpoint of PyTorch 0.1.10 to 1.5 (later ones write it on request). One after another
/// are five pickles: the magic number; the protocol version 1001; facts about the machine that
/// wrote it, which must have been little endian; the data, whose tensors name storages by key; the
/// list of these keys. Then for each key in that order the number of values (int64) and the values,
/// little endian.
///
/// Every number of values is checked against the file and against what the data says of the
/// storage. Memory as most_checkpoint_memory. Throws std::runtime_error naming the file.
std::unique_ptr<CheckpointArchive> open_legacy_checkpoint(const std::filesystem::path& file);

}  // namespace eventgan
