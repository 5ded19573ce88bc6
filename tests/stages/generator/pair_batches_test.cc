#include "stages/generator/pair_batches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <semaphore>
#include <stdexcept>
#include <thread>

namespace eventgan {
namespace {

/// A batch that computes 10 x the first value of each pair, records what it got, and can be held.
class TenTimes {
 public:
  std::vector<float> operator()(const PairBatches<float>::Pairs& pairs, ImageSize size) {
    ++batches_under_way_;
    EXPECT_EQ(batches_under_way_, 1);
    sizes.push_back(size);
    counts.push_back(pairs.size());
    entered.release();
    if (held) go_on.acquire();
    std::vector<float> values;
    for (const std::span<const float> pair : pairs) values.push_back(10 * pair[0]);
    --batches_under_way_;
    for (const float value : values) {
      if (value < 0) throw std::runtime_error("a negative pair");
    }
    return values;
  }

  std::atomic<bool> held = false;
  std::counting_semaphore<> entered{0};  ///< released once for each batch, when it begins
  std::counting_semaphore<> go_on{0};    ///< while `held`, acquired once by each batch
  std::vector<ImageSize> sizes;
  std::vector<std::size_t> counts;

 private:
  std::atomic<int> batches_under_way_ = 0;
};

class PairBatchesTest : public ::testing::Test {
 protected:
  float ask(float value, ImageSize size = {1, 1}) { return batches_.compute({&value, 1}, size); }

  /// A thread whose pair is under way, alone, until `compute_.go_on` is released.
  std::jthread hold_one() {
    compute_.held = true;
    std::jthread first([this] { EXPECT_EQ(ask(1), 10); });
    compute_.entered.acquire();
    return first;
  }

  void wait_until_there_wait(std::size_t pairs) const {
    while (batches_.waiting() < pairs) std::this_thread::yield();
  }

  /// Lets the batch that is held and all others go on.
  void let_go() {
    compute_.held = false;
    compute_.go_on.release();
  }

  TenTimes compute_;
  PairBatches<float> batches_{[](ImageSize size) { return size.height; }, std::ref(compute_)};
};

TEST_F(PairBatchesTest, OneThreadAloneGetsItsPairAtOnce) {
  for (int i = 0; i < 100; ++i) EXPECT_EQ(ask(float(i), {16, 1}), 10.0f * float(i));
  EXPECT_THAT(compute_.counts, ::testing::Each(1u));
}

TEST_F(PairBatchesTest, WhatWaitsIsComputedTogetherUpToTheMost) {
  std::jthread first = hold_one();
  std::vector<std::jthread> others;
  for (int i = 0; i < 7; ++i) {
    others.emplace_back([this, i] { EXPECT_EQ(ask(float(i), {4, 1}), 10.0f * float(i)); });
  }
  wait_until_there_wait(7);
  let_go();
  others.clear();
  EXPECT_THAT(compute_.counts, ::testing::ElementsAre(1u, 4u, 3u));
}

TEST_F(PairBatchesTest, AreOfOneSizeAndTheOldestComesFirst) {
  std::jthread first = hold_one();
  std::vector<std::jthread> others;
  for (int i = 0; i < 6; ++i) {
    others.emplace_back([this, i] { EXPECT_EQ(ask(float(i), {8 + i % 2, 1}), 10.0f * float(i)); });
    wait_until_there_wait(std::size_t(i) + 1);
  }
  let_go();
  others.clear();
  EXPECT_THAT(compute_.sizes,
              ::testing::ElementsAre(ImageSize{1, 1}, ImageSize{8, 1}, ImageSize{9, 1}));
  EXPECT_THAT(compute_.counts, ::testing::ElementsAre(1u, 3u, 3u));
}

TEST_F(PairBatchesTest, AnErrorReachesEveryCallerOfItsBatchAndNoOther) {
  std::jthread first = hold_one();
  std::atomic<int> failed = 0;
  std::vector<std::jthread> others;
  for (int i = 0; i < 4; ++i) {
    others.emplace_back([&, i] {
      try {
        EXPECT_EQ(ask(i == 0 ? -1.0f : float(i), {8 + i % 2, 1}), 10.0f * float(i));
        EXPECT_EQ(i % 2, 1);
      } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "a negative pair");
        EXPECT_EQ(i % 2, 0);
        ++failed;
      }
    });
  }
  wait_until_there_wait(4);
  let_go();
  others.clear();
  EXPECT_EQ(failed, 2);
  EXPECT_EQ(ask(5), 50);  // and the next batch is computed
}

TEST(PairBatches, AnErrorOfTheMostReachesItsCallerAndBlocksNobody) {
  std::atomic<int> asked = 0;
  TenTimes compute;
  PairBatches<float> batches(
      [&](ImageSize) -> int {
        if (asked++ % 2 == 0) throw std::bad_alloc();
        return 3;
      },
      std::ref(compute));
  std::atomic<int> failed = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&] {
      for (int i = 1; i <= 100; ++i) {
        const float value = float(i);
        try {
          EXPECT_EQ(batches.compute({&value, 1}, {1, 1}), 10 * value);
        } catch (const std::bad_alloc&) {
          ++failed;
        }
      }
    });
  }
  threads.clear();
  EXPECT_GT(failed, 0);
  EXPECT_LT(failed, 400);
  EXPECT_EQ(batches.waiting(), 0u);
}

TEST_F(PairBatchesTest, LoseNothingUnderManyThreads) {
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([this, thread] {
      for (int i = 0; i < 200; ++i) {
        const float value = float(1000 * thread + i);
        EXPECT_EQ(ask(value, {1 + i % 5, 1}), 10 * value);
      }
    });
  }
  threads.clear();
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < compute_.counts.size(); ++i) {
    pairs += compute_.counts[i];
    EXPECT_LE(compute_.counts[i], std::size_t(compute_.sizes[i].height));
  }
  EXPECT_EQ(pairs, 1600u);
}

}  // namespace
}  // namespace eventgan
