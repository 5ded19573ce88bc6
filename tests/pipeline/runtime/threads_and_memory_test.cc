#include <gtest/gtest.h>
#include <malloc.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <stdexcept>
#include <thread>
#include <vector>

#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(ThreadCount, IsTheRequestOrAllCores) {
  EXPECT_EQ(thread_count(1), 1);
  EXPECT_EQ(thread_count(4096), 4096);
  EXPECT_GE(thread_count(0), 1);
}

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

/// Works until its thread has used a millisecond more.
void work() {
  const std::int64_t start_ns = thread_processor_ns();
  while (thread_processor_ns() - start_ns < 1'000'000) {
  }
}

TEST(ProcessorTime, OfTheProcessHoldsThatOfEveryThread) {
  const std::int64_t thread_ns = thread_processor_ns();
  const std::int64_t process_ns = process_processor_ns();
  work();
  std::thread(work).join();
  EXPECT_GE(thread_processor_ns() - thread_ns, 1'000'000);
  EXPECT_GE(process_processor_ns() - process_ns, 2'000'000);
}

TEST(ProcessorTime, OfAThreadBeginsWithIt) {
  work();
  const std::int64_t here_ns = thread_processor_ns();
  std::int64_t there_ns = here_ns;
  std::thread([&] { there_ns = thread_processor_ns(); }).join();
  EXPECT_LT(there_ns, here_ns);
}

TEST(MemoryLimit, IsAtMostTheMachines) {
  EXPECT_GT(memory_limit_bytes(), std::size_t{1} << 20);
  EXPECT_LT(memory_limit_bytes(), std::size_t{1} << 50);
}

TEST(GroupMemoryLimit, IsTheLeastOfTheGroupAndThoseAbove) {
  const testing::TemporaryFolder root;
  std::filesystem::create_directories(root / "jobs/one/step");
  testing::write_file(root / "jobs/memory.max", "3000\n");
  testing::write_file(root / "jobs/one/memory.max", "5000\n");
  testing::write_file(root / "jobs/one/step/memory.max", "max\n");
  const std::filesystem::path folder = root / "";
  EXPECT_EQ(group_memory_limit_bytes(folder, "jobs/one/step", 9000), 3000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "jobs/one/step", 2000), 2000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "jobs", 9000), 3000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "/jobs/", 9000), 3000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "", 9000), 9000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "elsewhere", 9000), 9000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "../outside", 9000), 9000u);
}

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

TEST(PeakMemory, IsThatSinceItsRestart) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizers keep what is freed";
#endif
  constexpr std::size_t kBytes = 100'000'000;
  const auto touch = [] { std::vector<char>(kBytes, 1).back() = 2; };
  touch();
  if (!restart_peak_memory()) GTEST_SKIP() << "the kernel keeps the peak";
  const std::size_t before = peak_memory_bytes();
  ASSERT_GT(before, 0u);
  touch();
  EXPECT_GE(peak_memory_bytes(), before + kBytes / 10 * 9);
  ASSERT_TRUE(restart_peak_memory());
  EXPECT_LT(peak_memory_bytes(), before + kBytes / 2);
}

}  // namespace
}  // namespace eventgan
