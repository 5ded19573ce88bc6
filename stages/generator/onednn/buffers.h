#pragma once

#include <algorithm>
#include <cstddef>
#include <mutex>
#include <utility>
#include <vector>

namespace eventgan {

/// Places buffers one after another in one block of memory.
class BufferLayout {
 public:
  /// Offset of a new buffer, on a cache line of its own.
  std::size_t add(std::size_t size_bytes) {
    const std::size_t offset = aligned(total_bytes_);
    total_bytes_ = offset + size_bytes;
    return offset;
  }

  /// Where a cache line begins, `bytes` or next behind.
  static constexpr std::size_t aligned(std::size_t bytes) {
    constexpr std::size_t kLine = 64;
    return (bytes + kLine - 1) / kLine * kLine;
  }

  std::size_t total_bytes() const { return std::max<std::size_t>(total_bytes_, 1); }

 private:
  std::size_t total_bytes_ = 0;
};

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

/// Blocks of memory for calls that run at the same time: as many as there have been calls at once,
/// each as large as its largest call; they are kept until this is destroyed. Thread safe.
class BlockPool {
 public:
  /// A block that goes back when this is destroyed.
  class Lease {
   public:
    Lease(BlockPool& pool, PageBuffer block) : pool_(pool), block_(std::move(block)) {}
    ~Lease() { pool_.give_back(std::move(block_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;

    std::byte* data() const { return block_.data(); }

   private:
    BlockPool& pool_;
    PageBuffer block_;
  };

  /// size_bytes ≥ 1. Throws std::bad_alloc.
  Lease take(std::size_t size_bytes);

 private:
  void give_back(PageBuffer block) noexcept;

  std::mutex mutex_;
  std::vector<PageBuffer> free_;
};

}  // namespace eventgan
