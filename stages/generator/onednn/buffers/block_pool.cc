#include "stages/generator/onednn/buffers/block_pool.h"

#include <algorithm>
#include <new>
#include <optional>

namespace eventgan {

BlockPool::Lease BlockPool::take(std::size_t size_bytes) {
  std::optional<PageBuffer> block;
  {
    const std::lock_guard lock(mutex_);
    // The largest one, so that a call of another size replaces a block as seldom as possible.
    const auto largest = std::ranges::max_element(free_, {}, &PageBuffer::size_bytes);
    if (largest != free_.end()) {
      block = std::move(*largest);
      free_.erase(largest);
    }
  }
  if (!block || block->size_bytes() < size_bytes) {
    block.reset();  // first, so that old and new do not stand side by side
    block.emplace(size_bytes);
  }
  return {*this, std::move(*block)};
}

void BlockPool::give_back(PageBuffer block) noexcept {
  const std::lock_guard lock(mutex_);
  try {
    free_.push_back(std::move(block));
  } catch (const std::bad_alloc&) {
    // Then the block is not kept.
  }
}

}  // namespace eventgan
