#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace eventgan {

// Values as this program has them in memory, one behind the other: for itself to read again.

template <class Value>
void pack(std::string& bytes, const Value& value) {
  static_assert(std::is_trivially_copyable_v<Value>);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

template <class Value>
void pack(std::string& bytes, const std::vector<Value>& values) {
  static_assert(std::is_trivially_copyable_v<Value>);
  pack(bytes, static_cast<std::uint64_t>(values.size()));
  if (values.empty()) return;
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
}

inline void pack(std::string& bytes, const std::string& text) {
  pack(bytes, std::vector<char>(text.begin(), text.end()));
}

/// Each takes the next value off the front of `bytes`; false if there are too few of them.
template <class Value>
bool unpack(std::string_view& bytes, Value& value) {
  static_assert(std::is_trivially_copyable_v<Value>);
  if (bytes.size() < sizeof(value)) return false;
  std::memcpy(&value, bytes.data(), sizeof(value));
  bytes.remove_prefix(sizeof(value));
  return true;
}

template <class Value>
bool unpack(std::string_view& bytes, std::vector<Value>& values) {
  static_assert(std::is_trivially_copyable_v<Value>);
  std::uint64_t count = 0;
  if (!unpack(bytes, count) || count > bytes.size() / sizeof(Value)) return false;
  values.resize(count);
  if (count > 0) std::memcpy(values.data(), bytes.data(), count * sizeof(Value));
  bytes.remove_prefix(count * sizeof(Value));
  return true;
}

inline bool unpack(std::string_view& bytes, std::string& text) {
  std::vector<char> characters;
  if (!unpack(bytes, characters)) return false;
  text.assign(characters.begin(), characters.end());
  return true;
}

}  // namespace eventgan
