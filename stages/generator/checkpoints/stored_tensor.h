#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/weights.h"
#include "stages/base/archives/pickle.h"

namespace eventgan {

/// What a checkpoint's pickle may name: tensors, their storages, ordered dictionaries, and numpy's
/// numbers and arrays, which counters may be. Anything else is refused by name.
const std::set<std::string>& checkpoint_globals();

/// A number type that PyTorch stores.
struct StoredNumber {
  std::size_t size_bytes;
  float (*to_float)(const std::byte*);  ///< from little-endian bytes
};

/// What a checkpoint's pickle says about a storage: the persistent id ('storage', type, key,
/// location, number of values) and, before PyTorch 1.6, the part of it that is meant.
struct StorageId {
  StoredNumber number;
  std::string key;
  std::int64_t count = 0;       ///< values of the whole storage
  std::int64_t view_begin = 0;  ///< first value of the part
  std::int64_t view_count = 0;  ///< count if the whole is meant
};

/// Throws std::runtime_error "expected X, got Y" if the node is no such id, or the part lies
/// outside the storage.
StorageId parse_storage_id(const PickleNode& persistent);

/// A text node of Python 2 or 3.
const std::string& checkpoint_text(const PickleNode& node, std::size_t index, const char* what);

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
