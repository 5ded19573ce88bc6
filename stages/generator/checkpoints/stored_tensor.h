#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "manifests/state_dict.h"
#include "stages/archives/pickle/pickle.h"
#include "stages/generator/checkpoints/checkpoint_storages.h"

namespace eventgan {

/// A tensor as a checkpoint's pickle describes it: a view of a storage.
struct StoredTensor {
  StorageId storage;
  std::int64_t offset = 0;            ///< of the first value, counted in values of the part
  std::vector<std::int64_t> shape;    ///< at most 8 sides, each at least 1; [] is one value
  std::vector<std::int64_t> strides;  ///< in values, each at least 1
  std::int64_t count = 0;             ///< values: the product of the sides
};

/// From _rebuild_tensor_v2(storage, offset, shape, strides, ...) or a parameter around it. What it
/// says is checked against the storage's declared number of values, so `count` is no larger; an
/// expanded tensor (stride 0) is refused. Throws std::runtime_error "expected X, got Y".
StoredTensor parse_stored_tensor(const PickleNode& node);

/// The tensor's values out of the whole storage's bytes. Throws std::runtime_error if the storage
/// is shorter than declared.
NamedTensor gather(const StoredTensor& tensor, std::span<const std::byte> storage);

}  // namespace eventgan
