#include "stages/generator/onednn/buffers.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>
#include <optional>
#include <utility>

namespace eventgan {

PageBuffer::PageBuffer(std::size_t size_bytes) : size_bytes_(size_bytes) {
  constexpr std::size_t kHugePage = std::size_t{1} << 21;
  // mmap aligns to small pages only; what huge pages cannot cover at both ends stays small ones.
  void* pages =
      mmap(nullptr, size_bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (pages == MAP_FAILED) throw std::bad_alloc();
  data_ = static_cast<std::byte*>(pages);
#if defined(MADV_HUGEPAGE)
  if (size_bytes_ >= kHugePage)
    madvise(pages, size_bytes_, MADV_HUGEPAGE);  // advice: may be refused
#endif
}

PageBuffer::~PageBuffer() {
  if (data_) munmap(data_, size_bytes_);
}

PageBuffer::PageBuffer(PageBuffer&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)),
      size_bytes_(std::exchange(other.size_bytes_, 0)) {}

PageBuffer& PageBuffer::operator=(PageBuffer&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_bytes_, other.size_bytes_);
  return *this;
}

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
    block.reset();  // first, so that old and new are not held side by side
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
