#include "stages/generator/onednn/buffers/block_pool.h"

#include <gtest/gtest.h>

#include <cstring>

namespace eventgan {
namespace {

TEST(BlockPool, GivesTheSameBlockAgain) {
  BlockPool pool;
  std::byte* first = nullptr;
  {
    const auto block = pool.take(5000);
    first = block.data();
    std::memset(first, 1, 5000);
  }
  EXPECT_EQ(pool.take(4000).data(), first);
}

TEST(BlockPool, GivesCallsAtTheSameTimeDifferentBlocks) {
  BlockPool pool;
  const auto one = pool.take(1 << 22);
  const auto other = pool.take(1 << 22);
  std::memset(one.data(), 1, 1 << 22);
  std::memset(other.data(), 2, 1 << 22);
  EXPECT_EQ(one.data()[(1 << 22) - 1], std::byte{1});
  EXPECT_EQ(other.data()[0], std::byte{2});
}

TEST(BlockPool, ReplacesABlockThatIsTooSmall) {
  BlockPool pool;
  pool.take(10);
  const auto larger = pool.take(1 << 20);
  std::memset(larger.data(), 3, 1 << 20);
  EXPECT_EQ(larger.data()[(1 << 20) - 1], std::byte{3});
}

}  // namespace
}  // namespace eventgan
