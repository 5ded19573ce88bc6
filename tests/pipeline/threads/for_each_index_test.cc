#include "pipeline/threads/for_each_index.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace eventgan {
namespace {

TEST(ForEachIndex, TakesEachOnce) {
  for (const int threads : {1, 3, 64}) {
    for (const std::size_t count : {0, 1, 1000}) {
      std::vector<std::atomic<int>> calls(count);
      for_each_index(count, threads, [&](std::size_t i) { ++calls.at(i); });
      for (const auto& number : calls) EXPECT_EQ(number, 1);
    }
  }
}

TEST(ForEachIndex, PassesAnExceptionOn) {
  EXPECT_THROW(for_each_index(10, 2,
                              [](std::size_t i) {
                                if (i == 7) throw std::runtime_error("seven");
                              }),
               std::runtime_error);
}

}  // namespace
}  // namespace eventgan
