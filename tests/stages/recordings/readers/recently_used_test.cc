#include "stages/recordings/readers/detail/recently_used.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

namespace eventgan {
namespace {

using ::testing::ThrowsMessage;

std::function<RecentlyUsed::Made()> make(int number, std::int64_t weight = 1) {
  return [=] { return RecentlyUsed::Made{std::make_shared<const int>(number), weight}; };
}

std::function<RecentlyUsed::Made()> fail_with(const char* text) {
  return [=]() -> RecentlyUsed::Made { throw std::runtime_error(text); };
}

int number_of(const RecentlyUsed::Value& value) { return *static_cast<const int*>(value.get()); }

TEST(RecentlyUsed, WhatIsBeingMadeStays) {
  RecentlyUsed recent(1);
  recent.get(&recent, 0, [&] {  // others make more than is kept meanwhile
    for (std::size_t part = 1; part < 4; ++part) recent.get(&recent, part, make(7));
    return make(8)();
  });
  EXPECT_EQ(number_of(recent.get(&recent, 0, fail_with("is made"))), 8);
  for (std::size_t part = 1; part < 4; ++part) {
    EXPECT_THAT([&] { recent.get(&recent, part, fail_with("is made")); },
                ThrowsMessage<std::runtime_error>("is made"));
  }
}

TEST(RecentlyUsed, WhatCouldNotBeMadeIsMadeAgain) {
  RecentlyUsed recent(10);
  EXPECT_THAT([&] { recent.get(&recent, 0, fail_with("unreadable")); },
              ThrowsMessage<std::runtime_error>("unreadable"));
  EXPECT_EQ(number_of(recent.get(&recent, 0, make(7))), 7);
}

TEST(RecentlyUsed, OfAnOwnerThatIsGoneIsForgotten) {
  RecentlyUsed recent(10);
  const int owners[2] = {};
  for (const int& owner : owners) {
    for (std::size_t part = 0; part < 3; ++part) recent.get(&owner, part, make(7));
  }
  recent.forget(&owners[0]);
  EXPECT_THAT([&] { recent.get(&owners[0], 1, fail_with("is made")); },
              ThrowsMessage<std::runtime_error>("is made"));
  EXPECT_EQ(number_of(recent.get(&owners[1], 1, fail_with("is made"))), 7);
}

/// Asks for another value when it ends, as one may that needs a lock.
TEST(RecentlyUsed, ValuesEndWhileOthersAreAskedFor) {
  RecentlyUsed recent(1);
  int asked = 0;
  const auto ask = [&](const int* value) {
    delete value;
    asked += number_of(recent.get(&asked, 9, make(5)));
  };
  recent.get(&recent, 0, [&] {
    return RecentlyUsed::Made{std::shared_ptr<const int>(new int(1), ask), 1};
  });
  recent.get(&recent, 1, make(2));
  EXPECT_EQ(asked, 5);
}

TEST(RecentlyUsed, WhatIsStillUsedStaysWithItsUser) {
  RecentlyUsed recent(1);
  const RecentlyUsed::Value held = recent.get(&recent, 0, make(3));
  recent.get(&recent, 1, make(4));
  EXPECT_EQ(number_of(held), 3);
  EXPECT_EQ(number_of(recent.get(&recent, 0, make(6))), 6);
}

TEST(RecentlyUsed, OfManyThreadsOneMakes) {
  RecentlyUsed recent(3);
  std::atomic<int> made = 0, wrong = 0;
  const auto run = [](const auto& body) {
    std::vector<std::thread> threads;
    for (int i = 0; i < 8; ++i) threads.emplace_back(body);
    for (std::thread& thread : threads) thread.join();
  };
  run([&] {
    const auto value = recent.get(&recent, 0, [&] {
      ++made;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return make(1)();
    });
    wrong += number_of(value) != 1;
  });
  EXPECT_EQ(made, 1);
  run([&] {  // more than is kept
    for (int i = 0; i < 200; ++i) {
      wrong += number_of(recent.get(&made, static_cast<std::size_t>(i % 7), make(i % 7))) != i % 7;
    }
  });
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace eventgan
