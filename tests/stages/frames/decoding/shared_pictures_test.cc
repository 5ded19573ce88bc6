#include "stages/frames/decoding/shared_pictures.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <new>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

namespace eventgan {
namespace {

/// A picture of one pixel.
SharedFrame picture(int level) {
  return std::make_shared<Outcome<PreparedFrame>>(
      PreparedFrame{{static_cast<std::uint8_t>(level)}, {}});
}

int level_of(const SharedFrame& frame) { return std::get<PreparedFrame>(*frame).grey.at(0); }

/// Whether getting a picture made it, rather than found it.
bool was_made(SharedPictures& pictures, const std::string& name) {
  bool made = false;
  pictures.get(name, [&] {
    made = true;
    return picture(0);
  });
  return made;
}

TEST(SharedPictures, MakesEachOnceWhileItIsKept) {
  SharedPictures pictures(2);
  int made = 0;
  for (int round = 0; round < 3; ++round) {
    for (int level : {10, 20}) {
      const auto make = [&] { return ++made, picture(level); };
      EXPECT_EQ(level_of(pictures.get(std::to_string(level), make)), level);
    }
  }
  EXPECT_EQ(made, 2);
}

TEST(SharedPictures, TheOneUnusedForLongestGoes) {
  SharedPictures pictures(3);
  for (const char* name : {"a", "b", "c"}) EXPECT_TRUE(was_made(pictures, name));
  EXPECT_FALSE(was_made(pictures, "a"));  // so b is the one unused for longest
  EXPECT_TRUE(was_made(pictures, "d"));
  for (const char* name : {"a", "c", "d"}) EXPECT_FALSE(was_made(pictures, name)) << name;
  EXPECT_TRUE(was_made(pictures, "b"));
}

TEST(SharedPictures, KeepsAtLeastOne) {
  SharedPictures pictures(0);
  EXPECT_TRUE(was_made(pictures, "a"));
  EXPECT_FALSE(was_made(pictures, "a"));
  EXPECT_TRUE(was_made(pictures, "b"));
  EXPECT_TRUE(was_made(pictures, "a"));
}

TEST(SharedPictures, WhoHoldsAPictureKeepsItBeyondItsTime) {
  SharedPictures pictures(1);
  const SharedFrame held = pictures.get("a", [] { return picture(7); });
  EXPECT_TRUE(was_made(pictures, "b"));
  EXPECT_EQ(level_of(held), 7);
}

TEST(SharedPictures, AFaultIsKeptLikeAPicture) {
  SharedPictures pictures(2);
  int made = 0;
  for (int round = 0; round < 3; ++round) {
    const SharedFrame frame = pictures.get("a", [&] {
      ++made;
      return std::make_shared<Outcome<PreparedFrame>>(SampleFault{"bad"});
    });
    EXPECT_EQ(std::get<SampleFault>(*frame).reason, "bad");
  }
  EXPECT_EQ(made, 1);
}

TEST(SharedPictures, WhatMakeThrowsReachesEveryoneWhoAsks) {
  SharedPictures pictures(2);
  EXPECT_THROW(pictures.get("a", []() -> SharedFrame { throw std::bad_alloc(); }), std::bad_alloc);
  EXPECT_THROW(pictures.get("a", [] { return picture(1); }), std::bad_alloc);
  EXPECT_TRUE(was_made(pictures, "b"));
}

TEST(SharedPictures, WhoComesWhileOneIsMadeWaitsForIt) {
  SharedPictures pictures(1);
  std::latch started(1);
  std::latch evicted(1);
  std::atomic<int> made = 0;
  std::thread maker([&] {
    pictures.get("a", [&] {
      started.count_down();
      evicted.wait();
      return ++made, picture(5);
    });
  });
  started.wait();
  int waited_for = 0;
  std::thread waiter(
      [&] { waited_for = level_of(pictures.get("a", [&] { return ++made, picture(6); })); });
  // Another picture is made meanwhile: no lock is held. It may push "a" out before the waiter
  // comes, which then makes it itself.
  EXPECT_TRUE(was_made(pictures, "b"));
  evicted.count_down();
  maker.join();
  waiter.join();
  EXPECT_EQ(waited_for, made == 1 ? 5 : 6);
}

TEST(SharedPictures, ManyThreadsOnFewPicturesMakeEachOnce) {
  constexpr int kThreads = 8;
  constexpr int kPictures = 12;
  SharedPictures pictures(kPictures);
  std::vector<std::atomic<int>> made(kPictures);
  std::atomic<int> wrong = 0;
  std::latch together(kThreads);
  std::vector<std::thread> threads;
  for (int thread = 0; thread < kThreads; ++thread) {
    threads.emplace_back([&, thread] {
      std::mt19937 random(static_cast<unsigned>(thread));
      together.arrive_and_wait();
      for (int turn = 0; turn < 500; ++turn) {
        const int wanted = static_cast<int>(random() % kPictures);
        const SharedFrame frame = pictures.get(std::to_string(wanted), [&] {
          ++made[wanted];
          std::this_thread::yield();
          return picture(wanted);
        });
        wrong += level_of(frame) != wanted;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  for (const auto& count : made) EXPECT_EQ(count, 1);
}

TEST(SharedPictures, ManyThreadsAndTooLittleRoomStillGetTheRightPictures) {
  SharedPictures pictures(2);
  std::atomic<int> wrong = 0;
  std::vector<std::thread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&, thread] {
      std::mt19937 random(static_cast<unsigned>(thread));
      for (int turn = 0; turn < 500; ++turn) {
        const int wanted = static_cast<int>(random() % 6);
        wrong += level_of(pictures.get(std::to_string(wanted), [&] { return picture(wanted); })) !=
                 wanted;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace eventgan
