#pragma once

#include <algorithm>
#include <cstddef>

namespace eventgan {

/// Places buffers one after another in one block of memory.
class BufferLayout {
 public:
  /// Offset of a new buffer, on a cache line of its own.
  std::size_t add(std::size_t size_bytes) {
    constexpr std::size_t kLine = 64;
    const std::size_t offset = (total_bytes_ + kLine - 1) / kLine * kLine;
    total_bytes_ = offset + size_bytes;
    return offset;
  }

  std::size_t total_bytes() const { return std::max<std::size_t>(total_bytes_, 1); }

 private:
  std::size_t total_bytes_ = 0;
};

}  // namespace eventgan
