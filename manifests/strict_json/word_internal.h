#pragma once

#include <array>
#include <cstddef>
#include <stdexcept>
#include <string_view>

namespace eventgan {

/// A value of an enumeration and what a document calls it.
template <class T>
struct Word {
  std::string_view word;
  T value;
};

/// The word for `value`. Throws std::invalid_argument for a value that has none, which only a bad
/// cast can make.
template <class T, std::size_t N>
std::string_view word_of(const std::array<Word<T>, N>& words, T value) {
  for (const Word<T>& entry : words) {
    if (entry.value == value) return entry.word;
  }
  throw std::invalid_argument("expected a value of the enumeration, got another number");
}

}  // namespace eventgan
