#pragma once

#include <cstddef>

namespace eventgan {

/// Memory straight from the system, on huge pages where it grants them, so that a buffer of many
/// megabytes neither is faulted in page by page nor wears out the address cache. Not initialised
/// beyond zero.
class PageBuffer {
 public:
  /// size_bytes ≥ 1. Throws std::bad_alloc.
  explicit PageBuffer(std::size_t size_bytes);
  ~PageBuffer();
  PageBuffer(PageBuffer&& other) noexcept;
  PageBuffer& operator=(PageBuffer&& other) noexcept;

  std::byte* data() const { return data_; }
  std::size_t size_bytes() const { return size_bytes_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t size_bytes_ = 0;
};

}  // namespace eventgan
