#include "pipeline/memory/big_buffers.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <cstddef>
#include <cstdlib>

namespace eventgan {
namespace {

TEST(KeepBigBuffers, WhatIsFreedStaysWithTheProcess) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer has its own allocator";
#endif
  constexpr std::size_t kBytes = 100'000'000;
  keep_big_buffers();
  const std::size_t mappings = mallinfo2().hblks;
  void* const buffer = std::malloc(kBytes);
  ASSERT_NE(buffer, nullptr);
  EXPECT_EQ(mallinfo2().hblks, mappings);  // no mapping of its own
  std::free(buffer);
  EXPECT_GE(mallinfo2().fordblks, kBytes);  // free, and not given back
}

}  // namespace
}  // namespace eventgan
