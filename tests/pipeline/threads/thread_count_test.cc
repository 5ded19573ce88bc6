#include "pipeline/threads/thread_count.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(ThreadCount, IsTheRequestOrAllCores) {
  EXPECT_EQ(thread_count(1), 1);
  EXPECT_EQ(thread_count(4096), 4096);
  EXPECT_GE(thread_count(0), 1);
}

}  // namespace
}  // namespace eventgan
