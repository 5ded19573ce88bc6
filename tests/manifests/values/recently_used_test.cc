#include "manifests/values/recently_used.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <latch>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace eventgan {
namespace {

using ::testing::ThrowsMessage;
using Number = std::shared_ptr<const int>;
using Numbers = RecentlyUsed<int, Number>;

/// Each weighs as much as it is.
Numbers weighed(std::int64_t most) {
  return Numbers(most, [](const Number& number) { return std::int64_t{*number}; });
}

auto make(int number) {
  return [=] { return std::make_shared<const int>(number); };
}

auto fail_with(const char* text) {
  return [=]() -> Number { throw std::runtime_error(text); };
}

/// Whether getting it made it, rather than found it.
bool was_made(Numbers& numbers, int key, int number = 1) {
  bool made = false;
  numbers.get(key, [&] {
    made = true;
    return make(number)();
  });
  return made;
}

/// `body` in eight threads, of their number.
template <class Body>
void in_threads(const Body& body) {
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) threads.emplace_back([&body, i] { body(i); });
}

TEST(RecentlyUsed, TheOneUnusedForLongestGoes) {
  Numbers numbers(3);
  for (const int key : {1, 2, 3}) EXPECT_TRUE(was_made(numbers, key));
  EXPECT_FALSE(was_made(numbers, 1));  // so 2 is the one unused for longest
  EXPECT_TRUE(was_made(numbers, 4));
  for (const int key : {1, 3, 4}) EXPECT_FALSE(was_made(numbers, key)) << key;
  EXPECT_TRUE(was_made(numbers, 2));
}

TEST(RecentlyUsed, AsManyGoAsTheNewOneWeighs) {
  Numbers numbers = weighed(6);
  for (const int key : {1, 2, 3}) EXPECT_TRUE(was_made(numbers, key, 2));
  EXPECT_TRUE(was_made(numbers, 4, 3));  // 2 and 2 of 6 + 3 go
  EXPECT_FALSE(numbers.has(1));
  EXPECT_FALSE(numbers.has(2));
  EXPECT_FALSE(was_made(numbers, 3));
}

TEST(RecentlyUsed, WhatWeighsNothingGoesInItsTurn) {
  Numbers numbers = weighed(1);
  EXPECT_TRUE(was_made(numbers, 1, 0));
  EXPECT_TRUE(was_made(numbers, 2, 1));
  EXPECT_TRUE(numbers.has(1));
  EXPECT_TRUE(was_made(numbers, 3, 1));
  EXPECT_FALSE(numbers.has(1));
}

TEST(RecentlyUsed, TheLatestStaysHoweverMuchItWeighs) {
  for (const bool is_weighed : {false, true}) {
    Numbers numbers = is_weighed ? weighed(1) : Numbers(0);
    EXPECT_TRUE(was_made(numbers, 1, 7));
    EXPECT_FALSE(was_made(numbers, 1));
    EXPECT_TRUE(was_made(numbers, 2, 7));
    EXPECT_TRUE(was_made(numbers, 1));
  }
}

TEST(RecentlyUsed, WhatIsStillUsedStaysWithItsUser) {
  Numbers numbers(1);
  const Number held = numbers.get(1, make(3));
  numbers.get(2, make(4));
  EXPECT_EQ(*held, 3);
  EXPECT_EQ(*numbers.get(1, make(6)), 6);
}

TEST(RecentlyUsed, WhatIsBeingMadeStays) {
  Numbers numbers(1);
  numbers.get(0, [&] {  // others make more than is kept meanwhile
    for (const int key : {1, 2, 3}) EXPECT_TRUE(was_made(numbers, key));
    return make(8)();
  });
  EXPECT_EQ(*numbers.get(0, fail_with("is made")), 8);
  for (const int key : {1, 2, 3}) EXPECT_FALSE(numbers.has(key));
}

TEST(RecentlyUsed, WhatCouldNotBeMadeTakesNoPlaceAndIsMadeAgain) {
  Numbers numbers = weighed(10);
  EXPECT_THAT([&] { numbers.get(0, fail_with("unreadable")); },
              ThrowsMessage<std::runtime_error>("unreadable"));
  EXPECT_FALSE(numbers.has(0));
  EXPECT_EQ(*numbers.get(0, make(7)), 7);
  EXPECT_FALSE(was_made(numbers, 0));
}

TEST(RecentlyUsed, WhatMakeThrowsReachesAllThatWait) {
  Numbers numbers(2);
  std::latch started(1);
  std::atomic<int> failures = 0;
  const auto counted = [&](const auto& body) {
    try {
      numbers.get(0, body);
    } catch (const std::runtime_error&) {  // ThreadSanitizer does not see how it is shared
      ++failures;
    }
  };
  in_threads([&](int thread) {
    if (thread > 0) {
      started.wait();
      return counted(fail_with("unreadable"));  // where the first one has failed already
    }
    counted([&]() -> Number {
      started.count_down();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      throw std::runtime_error("unreadable");
    });
  });
  EXPECT_EQ(failures, 8);
  EXPECT_FALSE(numbers.has(0));
}

TEST(RecentlyUsed, TheKeysOfARangeAreForgotten) {
  Numbers numbers = weighed(5);
  for (const int key : {1, 2, 3, 4, 5}) EXPECT_TRUE(was_made(numbers, key));
  numbers.forget(2, 4);
  for (const int key : {2, 3, 4}) EXPECT_FALSE(numbers.has(key)) << key;
  EXPECT_TRUE(was_made(numbers, 6, 3));  // in their room
  EXPECT_TRUE(numbers.has(1));
  EXPECT_TRUE(numbers.has(5));
}

/// Asks for another value when it ends, as one may that needs a lock.
TEST(RecentlyUsed, ValuesEndWhileOthersAreAskedFor) {
  Numbers numbers(1);
  int asked = 0;
  const auto ask = [&](const int* value) {
    delete value;
    asked += *numbers.get(9, make(5));
  };
  numbers.get(0, [&] { return Number(new int(1), ask); });
  numbers.get(1, make(2));
  EXPECT_EQ(asked, 5);
}

TEST(RecentlyUsed, OfManyThreadsOneMakes) {
  Numbers numbers(3);
  std::atomic<int> made = 0, wrong = 0;
  in_threads([&](int) {
    const Number value = numbers.get(0, [&] {
      ++made;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return make(1)();
    });
    wrong += *value != 1;
  });
  EXPECT_EQ(made, 1);
  EXPECT_EQ(wrong, 0);
}

TEST(RecentlyUsed, OthersAreMadeMeanwhile) {
  Numbers numbers(1);
  std::latch started(1), other_is_made(1);
  std::jthread maker([&] {
    numbers.get(0, [&] {
      started.count_down();
      other_is_made.wait();
      return make(5)();
    });
  });
  started.wait();
  int waited_for = 0;
  std::jthread waiter([&] { waited_for = *numbers.get(0, make(6)); });
  EXPECT_TRUE(was_made(numbers, 1));
  other_is_made.count_down();
  maker.join();
  waiter.join();
  EXPECT_EQ(waited_for, 5);
}

TEST(RecentlyUsed, ManyThreadsMakeEachOnceWhereThereIsRoom) {
  constexpr int kKeys = 12;
  for (const std::int64_t most : {kKeys, 2}) {
    Numbers numbers(most);
    std::vector<std::atomic<int>> made(kKeys);
    std::atomic<int> wrong = 0;
    in_threads([&](int thread) {
      std::mt19937 random(static_cast<unsigned>(thread));
      for (int turn = 0; turn < 500; ++turn) {
        const int wanted = static_cast<int>(random() % kKeys);
        const Number number = numbers.get(wanted, [&] {
          ++made[wanted];
          std::this_thread::yield();
          return make(wanted)();
        });
        wrong += *number != wanted;
      }
    });
    EXPECT_EQ(wrong, 0);
    for (const auto& count : made) EXPECT_TRUE(count == 1 || most < kKeys);
  }
}

}  // namespace
}  // namespace eventgan
