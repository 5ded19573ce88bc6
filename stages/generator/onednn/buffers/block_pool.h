#pragma once

#include <cstddef>
#include <mutex>
#include <utility>
#include <vector>

#include "stages/generator/onednn/buffers/page_buffer.h"

namespace eventgan {

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
