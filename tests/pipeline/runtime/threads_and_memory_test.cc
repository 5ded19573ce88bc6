#include <gtest/gtest.h>
#include <malloc.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/runtime/control_groups.h"
#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(ThreadCount, IsTheRequestOrAllCores) {
  EXPECT_EQ(thread_count(1), 1);
  EXPECT_EQ(thread_count(4096), 4096);
  EXPECT_GE(thread_count(0), 1);
}

TEST(ForEachIndex, TakesEachOnceAndPassesAnExceptionOn) {
  for (const int threads : {1, 3, 64}) {
    for (const std::size_t count : {0, 1, 1000}) {
      std::vector<std::atomic<int>> calls(count);
      for_each_index(count, threads, [&](std::size_t i) { ++calls.at(i); });
      for (const auto& number : calls) EXPECT_EQ(number, 1);
    }
  }
  EXPECT_THROWS(for_each_index(10, 2,
                               [](std::size_t i) {
                                 if (i == 7) throw std::runtime_error("seven");
                               }),
                std::runtime_error, "seven");
}

TEST(ForEachIndex, HasItsThreadsWithinACallOfOneThread) {
  constexpr int kThreads = 4;
  std::atomic<int> together = 0;
  for_each_index(1, 1, [&](std::size_t) {
    const auto begin = std::chrono::steady_clock::now();
    std::atomic<int> arrived = 0;  // each waits for all, whom fewer threads would never bring
    for_each_index(kThreads, kThreads, [&](std::size_t) {
      ++arrived;
      while (arrived < kThreads &&
             std::chrono::steady_clock::now() - begin < std::chrono::seconds(20)) {
        std::this_thread::yield();
      }
      if (arrived == kThreads) ++together;
    });
  });
  EXPECT_EQ(together, kThreads);
}

/// Works until its thread has used a millisecond more.
void work() {
  const std::int64_t start_ns = thread_processor_ns();
  while (thread_processor_ns() - start_ns < 1'000'000) {
  }
}

#ifdef __SANITIZE_THREAD__
/// What is not built for the sanitizer must not hide it.
TEST(ForEachIndex, ARaceInItsTasksIsFound) {
  const auto race = [] {
    std::atomic<int> here = 0;
    int shared = 0;
    for_each_index(2, 2, [&](std::size_t) {
      here.fetch_add(1, std::memory_order_relaxed);
      while (here.load(std::memory_order_relaxed) < 2) std::this_thread::yield();
      ++shared;
    });
    std::exit(0);
  };
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(race(), ::testing::ExitedWithCode(66), "ThreadSanitizer: data race");
}
#endif

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

/// A file system of its own with control groups.
class ControlGroups : public ::testing::Test {
 protected:
  void say(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((root_ / file).parent_path());
    testing::write_file(root_ / file, text);
  }

  std::uint64_t memory_bytes() const { return control_group_limits(root_.path()).memory_bytes; }
  double processors() const { return control_group_limits(root_.path()).processors; }

  testing::TemporaryFolder root_;
  const std::uint64_t any_bytes_ = GroupLimits().memory_bytes;
  const double any_processors_ = GroupLimits().processors;
};

TEST_F(ControlGroups, ThatAreNotThereLimitNothing) {
  EXPECT_EQ(memory_bytes(), any_bytes_);
  EXPECT_EQ(processors(), any_processors_);
  say("proc/self/cgroup", "0::/jobs/one\n\nnonsense\n");
  EXPECT_EQ(memory_bytes(), any_bytes_);
  EXPECT_EQ(processors(), any_processors_);
}

TEST_F(ControlGroups, OfVersion2TheTightestFromTheOwnOneToTheTopCounts) {
  say("proc/self/cgroup", "0::/jobs/one/step\n");
  say("sys/fs/cgroup/jobs/memory.max", "3000\n");
  say("sys/fs/cgroup/jobs/one/memory.max", "5000\n");
  say("sys/fs/cgroup/jobs/one/step/memory.max", "max\n");
  say("sys/fs/cgroup/jobs/other/memory.max", "1\n");
  say("sys/fs/cgroup/jobs/cpu.max", "max 100000\n");
  say("sys/fs/cgroup/jobs/one/cpu.max", "400000 100000\n");
  say("sys/fs/cgroup/jobs/one/step/cpu.max", "90000 20000\n");
  say("sys/fs/cgroup/jobs/other/cpu.max", "1 100000\n");
  EXPECT_EQ(memory_bytes(), 3000u);
  EXPECT_EQ(processors(), 4);
  say("sys/fs/cgroup/jobs/one/step/cpu.max", "30000 20000\n");
  EXPECT_EQ(processors(), 1.5);
}

TEST_F(ControlGroups, OfVersion2AContainerSeesItsOwnAtTheTop) {
  say("sys/fs/cgroup/memory.max", "7000\n");
  say("sys/fs/cgroup/cpu.max", "200000 100000\n");
  for (const char* group : {"0::/\n", "0::/kubepods/pod7\n", "0::/../../other\n"}) {
    say("proc/self/cgroup", group);
    EXPECT_EQ(memory_bytes(), 7000u) << group;
    EXPECT_EQ(processors(), 2) << group;
  }
}

TEST_F(ControlGroups, OfVersion1EachControllerHasItsOwnTree) {
  say("proc/self/cgroup",
      "11:cpuset:/docker/7\n5:memory:/docker/7\n3:cpuacct,cpu:/docker/8\n0::/docker/9\n");
  say("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  say("sys/fs/cgroup/memory/docker/7/memory.limit_in_bytes", "6000\n");
  say("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  say("sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  say("sys/fs/cgroup/cpu/docker/8/cpu.cfs_quota_us", "250000\n");
  say("sys/fs/cgroup/cpu/docker/8/cpu.cfs_period_us", "100000\n");
  say("sys/fs/cgroup/cpu/docker/7/cpu.cfs_quota_us", "1000\n");  // the memory's group
  say("sys/fs/cgroup/cpu/docker/7/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(memory_bytes(), 6000u);
  EXPECT_EQ(processors(), 2.5);
}

TEST_F(ControlGroups, OfVersion1AContainerSeesItsOwnAtTheTop) {
  say("proc/self/cgroup", "5:memory:/docker/7\n3:cpu:/docker/7\n");
  say("sys/fs/cgroup/memory/memory.limit_in_bytes", "6000\n");
  say("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "50000\n");
  say("sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(memory_bytes(), 6000u);
  EXPECT_EQ(processors(), 0.5);
}

TEST_F(ControlGroups, DecideWhatMemoryAndThreadsThereAre) {
  const int all = thread_count(0, root_.path());
  EXPECT_GT(memory_limit_bytes(root_.path()), std::size_t{1} << 20);
  say("proc/self/cgroup", "0::/\n");
  say("sys/fs/cgroup/memory.max", "1048576\n");
  EXPECT_EQ(memory_limit_bytes(root_.path()), std::size_t{1} << 20);
  const auto threads_of = [&](const std::string& quota) {
    say("sys/fs/cgroup/cpu.max", quota + " 100000\n");
    return thread_count(0, root_.path());
  };
  EXPECT_EQ(threads_of("20000"), 1);
  EXPECT_EQ(threads_of("100000"), 1);
  EXPECT_EQ(threads_of("150000"), std::min(all, 2));
  EXPECT_EQ(threads_of("100000000000"), all);
  EXPECT_EQ(thread_count(7, root_.path()), 7);
}

TEST(ThreadCount, MindsTheAffinity) {
  cpu_set_t before, one;
  ASSERT_EQ(::sched_getaffinity(0, sizeof(before), &before), 0);
  CPU_ZERO(&one);
  for (int core = 0; core < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++core) {
    if (CPU_ISSET(core, &before)) CPU_SET(core, &one);
  }
  // oneTBB looks once in a process, so this takes one of its own.
  const auto count = [&] {
    ::sched_setaffinity(0, sizeof(one), &one);
    std::exit(thread_count(0));
  };
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(count(), ::testing::ExitedWithCode(1), "");
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
