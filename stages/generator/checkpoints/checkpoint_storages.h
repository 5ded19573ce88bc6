#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "stages/archives/pickle/pickle.h"

namespace eventgan {

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

}  // namespace eventgan
