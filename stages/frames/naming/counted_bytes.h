#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "manifests/files/input_file.h"

namespace eventgan {

/// A file read byte for byte, which knows how many the parser has taken.
class CountedBytes {
 public:
  explicit CountedBytes(const InputFile& file) : file_(file) { fill(); }

  bool at_end() const { return next_ == end_; }
  char current() const { return block_[next_]; }
  void advance() {
    ++taken_;
    if (++next_ == end_) fill();
  }
  /// Bytes taken so far: right after a brace, the offset of what follows it.
  std::uint64_t taken() const { return taken_; }

 private:
  void fill() {
    next_ = 0;
    end_ = file_.read_some(taken_, block_);
  }

  const InputFile& file_;
  std::array<char, 1 << 16> block_;
  std::size_t next_ = 0, end_ = 0;
  std::uint64_t taken_ = 0;
};

/// The same as the parser takes it. All copies share the bytes; one without is the end.
class CountedIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = char;

  CountedIterator() = default;
  explicit CountedIterator(CountedBytes& bytes) : bytes_(&bytes) {}
  char operator*() const { return bytes_->current(); }
  CountedIterator& operator++() {
    bytes_->advance();
    return *this;
  }
  CountedIterator operator++(int) {
    CountedIterator before = *this;
    bytes_->advance();
    return before;
  }
  bool is_end() const { return bytes_ == nullptr || bytes_->at_end(); }
  friend bool operator==(const CountedIterator& a, const CountedIterator& b) {
    return a.is_end() == b.is_end();
  }
  friend bool operator!=(const CountedIterator& a, const CountedIterator& b) { return !(a == b); }

 private:
  CountedBytes* bytes_ = nullptr;
};

}  // namespace eventgan
