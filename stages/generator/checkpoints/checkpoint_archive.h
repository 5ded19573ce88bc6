#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "stages/archives/pickle/pickle.h"

namespace eventgan {

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

/// What a checkpoint's pickle may name: tensors, their storages, ordered dictionaries, and numpy's
/// numbers and arrays, which counters may be. Anything else is refused by name.
const std::set<std::string>& checkpoint_globals();

}  // namespace eventgan
