#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

// Checkpoints written by hand: pickle opcodes of protocol 2, named as Python's pickletools names
// them, and the file formats around them.

namespace eventgan::testing {

std::string pickled_text(const std::string& value);  ///< BINUNICODE
std::string pickled_integer(std::int32_t value);     ///< BININT
std::string pickled_integers(const std::vector<int>& values);
std::string pickled_global(const std::string& module, const std::string& name);
std::string pickled_tuple(const std::string& items);
std::string pickled_dict(const std::string& keys_and_values);
std::string pickled_list(const std::string& items);

/// A whole pickle: PROTO, the value, STOP.
std::string whole_pickle(const std::string& value);

/// What a pickle says of a tensor; `count` is that of its storage.
struct PickledTensor {
  std::string type = "FloatStorage";
  std::string key = "0";
  int count = 6;
  std::string view;  ///< pickled; empty: the id has no such item
  int offset = 0;
  std::vector<int> shape = {2, 3};
  std::vector<int> stride = {3, 1};
};

std::string pickled_tensor(const PickledTensor& tensor);

/// A storage's values as they lie in memory.
template <class T>
std::string raw_bytes(std::initializer_list<T> values) {
  return {reinterpret_cast<const char*>(values.begin()), values.size() * sizeof(T)};
}

/// One storage of a checkpoint in the format before PyTorch 1.6.
struct LegacyStorage {
  std::string key;
  std::int64_t count = 0;
  std::string bytes;
};

/// The parts of such a checkpoint; pickled values without PROTO and STOP.
struct LegacyFile {
  std::string magic;    ///< as PyTorch's unless set
  std::string version;  ///< 1001
  std::string machine;  ///< a little-endian one
  std::string data;
  std::vector<LegacyStorage> storages;

  LegacyFile(std::string pickled_data, std::vector<LegacyStorage> with_storages);

  std::string bytes() const;
};

}  // namespace eventgan::testing
