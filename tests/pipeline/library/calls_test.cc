// The library's functions as C calls them: what they refuse, how threads share a batch, forks under
// load, the end of a process whose threads still call.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/library/eventgan.h"

namespace {

constexpr int kHeight = 21;
constexpr int kWidth = 34;
constexpr std::int64_t kPixels = std::int64_t{kHeight} * kWidth;
constexpr std::uint64_t kVolume = std::uint64_t{18} * kPixels;

/// Images that differ from each other.
std::vector<std::uint8_t> levels(std::int64_t count, unsigned seed) {
  std::vector<std::uint8_t> values(static_cast<std::size_t>(count * kPixels));
  std::uint32_t state = seed;
  for (std::uint8_t& value : values) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<std::uint8_t>(state >> 24);
  }
  return values;
}

eventgan_images images_at(const std::vector<std::uint8_t>& values, std::int64_t count) {
  return {values.data(), count, kHeight, kWidth, {kPixels, kWidth, 1, 0}, 1, EVENTGAN_UINT8};
}

class Calls : public ::testing::Test {
 protected:
  static constexpr std::int64_t kCount = 12;

  void SetUp() override {
    ASSERT_EQ(eventgan_load(R"({"generator": {"weights": "untrained:4"}})", &generator_),
              EVENTGAN_COMPLETE)
        << eventgan_error();
    expected_.resize(kVolume * kCount);
    ASSERT_EQ(generate(expected_), EVENTGAN_COMPLETE) << eventgan_error();
    ASSERT_GT(*std::max_element(expected_.begin(), expected_.end()), 0);
  }
  void TearDown() override { eventgan_free(generator_); }

  int generate(std::vector<float>& volumes, std::int64_t* next = nullptr, std::int64_t most = 0) {
    return eventgan_generate(generator_, &previous_, &following_, 0, volumes.data(), volumes.size(),
                             next, most);
  }

  /// Calls until it is told to stop; counts the volumes that are not as they should be.
  void call_on(std::atomic<bool>& stop, std::atomic<int>& wrong) {
    std::vector<float> made(expected_.size());
    while (!stop) {
      const int result = generate(made);
      if (result != EVENTGAN_COMPLETE || made != expected_) ++wrong;
    }
  }

  std::vector<std::uint8_t> first_ = levels(kCount, 1);
  std::vector<std::uint8_t> second_ = levels(kCount, 2);
  eventgan_images previous_ = images_at(first_, kCount);
  eventgan_images following_ = images_at(second_, kCount);
  eventgan_generator* generator_ = nullptr;
  std::vector<float> expected_;
};

TEST(Loading, RefusesWhatIsNoManifest) {
  eventgan_generator* generator = nullptr;
  EXPECT_EQ(eventgan_load("{", &generator), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_load("[]", &generator), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_load(nullptr, &generator), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_load("{}", nullptr), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_load(R"({"generator": {"kind": "x", "scope": "y"}})", &generator),
            EVENTGAN_USAGE);
  const std::string text = eventgan_error();
  EXPECT_NE(text.find("$.generator.kind: expected"), text.npos) << text;
  EXPECT_NE(text.find("$.generator.scope: expected"), text.npos) << text;
  EXPECT_EQ(eventgan_load(R"({"generator": {"weights": "/nowhere.safetensors"}})", &generator),
            EVENTGAN_INPUT_MISSING);
  EXPECT_NE(std::string(eventgan_error()).find("/nowhere.safetensors"), std::string::npos);
  EXPECT_EQ(generator, nullptr);
  eventgan_free(nullptr);
}

TEST_F(Calls, DescribeThemselves) {
  const std::string text = eventgan_describe(generator_);
  EXPECT_NE(text.find("\"bins\":9"), text.npos) << text;
  EXPECT_NE(text.find("UNTRAINED"), text.npos) << text;
  std::int32_t shape[3];
  double map[6];
  ASSERT_EQ(eventgan_shape(generator_, kHeight, kWidth, 1, 1, shape, map), EVENTGAN_COMPLETE);
  EXPECT_EQ(std::vector(shape, shape + 3), (std::vector{18, kHeight, kWidth}));
  EXPECT_EQ(std::vector(map, map + 6), (std::vector<double>{1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(eventgan_shape(generator_, 0, 5, 1, 1, shape, map), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_shape(generator_, 5, 5, -1, 1, shape, map), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_shape(generator_, 5, 5, 1, 0, shape, map), EVENTGAN_USAGE);
  EXPECT_EQ(eventgan_shape(generator_, 8192, 8192, 100'000, 1, shape, map), EVENTGAN_OUT_OF_MEMORY);
  EXPECT_EQ(eventgan_shape(nullptr, 5, 5, 1, 1, shape, map), EVENTGAN_USAGE);
}

TEST_F(Calls, RefuseWhatDoesNotFit) {
  std::vector<float> made(kVolume * kCount);
  const eventgan_images whole = following_;
  const auto refused = [&](const char* why) {
    EXPECT_EQ(generate(made), EVENTGAN_USAGE);
    EXPECT_NE(std::string(eventgan_error()).find(why), std::string::npos) << eventgan_error();
    following_ = whole;
  };
  following_.count = 3;
  refused("got 12 of (21, 34) and 3 of (21, 34)");
  following_.width = 33;
  refused("and 12 of (21, 33)");
  following_.channels = 2;
  refused("1 or 3 channels");
  following_.number = 3;
  refused("got 3 for following");
  following_.data = nullptr;
  refused("nowhere for following");
  following_.height = -4;
  refused("pixels");
  made.resize(made.size() - 1);
  refused("volumes of 154224 values");
  EXPECT_EQ(
      eventgan_generate(nullptr, &previous_, &following_, 0, made.data(), made.size(), nullptr, 0),
      EVENTGAN_USAGE);
  EXPECT_EQ(
      eventgan_generate(generator_, nullptr, &following_, 0, made.data(), made.size(), nullptr, 0),
      EVENTGAN_USAGE);
}

/// Fletcher's sums of one 16-bit word that is not zero, behind what is zero, are that word.
TEST(Decoding, GivesTheValuesOfAChunk) {
  // The halves 1 and 2, 0x3c00 and 0x4000, shuffled.
  std::vector<std::uint8_t> chunk{0x00, 0x00, 0x3c, 0x40, 0x40, 0x3c, 0x40, 0x3c};
  std::vector<float> volume(2);
  const auto decode = [&](std::int32_t number_size, std::int32_t is_deflated, float scale) {
    return eventgan_decode(chunk.data(), chunk.size(), number_size, is_deflated, scale,
                           volume.data(), volume.size());
  };
  ASSERT_EQ(decode(2, 0, 1), EVENTGAN_COMPLETE) << eventgan_error();
  EXPECT_EQ(volume, (std::vector<float>{1, 2}));
  EXPECT_EQ(decode(1, 0, 1), EVENTGAN_INPUT_MISSING);
  EXPECT_STREQ(eventgan_error(), "expected an intact volume of 2 values, got a damaged one");
  EXPECT_EQ(decode(2, 1, 1), EVENTGAN_INPUT_MISSING);
  for (const std::int32_t size : {0, -1, 3, 8}) EXPECT_EQ(decode(size, 0, 1), EVENTGAN_USAGE);
  chunk[2] ^= 1;
  EXPECT_EQ(decode(2, 0, 1), EVENTGAN_INPUT_MISSING);
  chunk = {3, 5, 5, 3, 5, 3};
  ASSERT_EQ(decode(1, 0, 0.5f), EVENTGAN_COMPLETE);
  EXPECT_EQ(volume, (std::vector<float>{1.5f, 2.5f}));
  chunk.clear();
  EXPECT_NE(decode(1, 0, 1), EVENTGAN_COMPLETE);
  EXPECT_EQ(eventgan_decode(nullptr, 6, 1, 0, 1, volume.data(), 2), EVENTGAN_USAGE);
  // Sizes whose bytes are more than 2^64 count as what is left of them: as none here.
  const std::array<std::byte, 4> zeros{};
  for (const std::uint64_t size : {std::uint64_t{1} << 62, std::uint64_t{1} << 63}) {
    for (const int number_size : {1, 2, 4}) {
      EXPECT_EQ(eventgan_decode(zeros.data(), zeros.size(), number_size, 0, 1, volume.data(), size),
                EVENTGAN_USAGE)
          << size;
    }
  }
}

/// 2 bins h w is 2^64, so 0 values; twice the bins is beyond an int.
TEST(SampledEvents, AreOfAVolumeThatFitsIntoMemory) {
  eventgan_event* events = nullptr;
  std::uint64_t count = 0;
  for (const auto& [bins, height, width] :
       {std::array{1 << 29, 1 << 17, 1 << 17}, std::array{1 << 30, 1 << 17, 1 << 17},
        std::array{0x7fffffff, 1, 1}, std::array{9, 46341, 46341}}) {
    const float value = 0;
    EXPECT_EQ(eventgan_sample_events(&value, bins, height, width, 1, 0, 0, &events, &count),
              EVENTGAN_USAGE)
        << bins;
  }
  const float value = -1e-45f;
  EXPECT_EQ(eventgan_sample_events(&value, 1, 1, 1, 1, 0, 0, &events, &count), EVENTGAN_USAGE);
  EXPECT_STREQ(eventgan_error(), "expected finite values >= 0, got -1e-45");
}

TEST(Represented, AreOfAsManyValuesAsFit) {
  const eventgan_event events[] = {{0, 0, 0, 1}, {1, 1, 0, 0}};
  std::int32_t channels = -1, number = -1;
  std::array<std::uint8_t, 8> values{};
  const auto represent = [&](const char* word, int height, void* to, std::uint64_t size) {
    return eventgan_represent(events, 2, word, height, 2, nullptr, &channels, &number, to, size);
  };
  EXPECT_EQ(represent("histogram:2", 1, values.data(), 8), EVENTGAN_COMPLETE);
  EXPECT_EQ(channels, 4);
  EXPECT_EQ(number, EVENTGAN_UINT8);
  // Negative bins first; the last event is in the last bin.
  EXPECT_EQ(values, (std::array<std::uint8_t, 8>{0, 0, 0, 1, 1, 0, 0, 0}));
  EXPECT_EQ(represent("eros:3", 1, nullptr, 0), EVENTGAN_COMPLETE);
  EXPECT_EQ(channels, 0);
  const std::tuple<const char*, int, std::uint64_t, const char*> refused[] = {
      {"histogram:2", 1, 7, "expected room for 8 bytes, got 7"},
      {"histogram:2", 0, 8, "expected a size of 1 x 1 or more"},
      {"histogram:64", 1 << 24, 8, "and at most 1073741824 values"},
      {"rows:2", 1, 8, "expected a representation of volume:B"},
      {nullptr, 1, 8, "expected a representation, got NULL"}};
  for (const auto& [word, height, size, message] : refused) {
    EXPECT_EQ(represent(word, height, values.data(), size), EVENTGAN_USAGE);
    EXPECT_THAT(eventgan_error(), ::testing::HasSubstr(message));
  }
}

TEST_F(Calls, MakeNoMoreThanTheyAreAskedFor) {
  std::vector<float> made(expected_.size(), -1);
  std::int64_t next = 0;
  ASSERT_EQ(generate(made, &next, 2), EVENTGAN_COMPLETE);
  EXPECT_EQ(next, 2);
  const auto second = static_cast<std::ptrdiff_t>(2 * kVolume);
  EXPECT_TRUE(std::equal(made.begin(), made.begin() + second, expected_.begin()));
  EXPECT_TRUE(std::all_of(made.begin() + second, made.end(), [](float v) { return v == -1; }));
  ASSERT_EQ(generate(made, &next, kCount), EVENTGAN_COMPLETE);
  EXPECT_EQ(made, expected_);
  next = kCount;
  std::fill(made.begin(), made.end(), -1.0f);
  ASSERT_EQ(generate(made, &next, kCount), EVENTGAN_COMPLETE);
  EXPECT_EQ(made, std::vector<float>(made.size(), -1));
}

TEST_F(Calls, ShareABatchAmongThreads) {
  std::vector<float> made(expected_.size());
  std::int64_t next = 0;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 5; ++i) {
      threads.emplace_back(
          [&] { EXPECT_EQ(generate(made, &next, kCount), EVENTGAN_COMPLETE) << eventgan_error(); });
    }
  }
  EXPECT_EQ(made, expected_);
}

TEST_F(Calls, OneThatFailsStopsTheOthers) {
  std::vector<double> numbers(static_cast<std::size_t>(kCount * kPixels), 0.5);
  numbers[static_cast<std::size_t>(3 * kPixels + kWidth + 2)] = -1;
  following_ = {numbers.data(),  kCount, kHeight, kWidth, {8 * kPixels, 8 * kWidth, 8, 0}, 1,
                EVENTGAN_FLOAT64};
  std::vector<float> made(expected_.size());
  std::int64_t next = 0;
  EXPECT_EQ(generate(made, &next, kCount), EVENTGAN_USAGE);
  EXPECT_NE(std::string(eventgan_error()).find("got -1 at row 1, column 2 of following"),
            std::string::npos)
      << eventgan_error();
  EXPECT_EQ(next, kCount);
}

TEST_F(Calls, AForkedChildComputesWhateverOtherThreadsAreAt) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer of GCC 12 leaves its allocator locked in a child, if another "
                  "thread allocates during the fork";
#endif
  std::atomic<bool> stop = false;
  std::atomic<int> wrong = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 3; ++i) threads.emplace_back([&] { call_on(stop, wrong); });
  // Before the threads are joined, even if an assertion fails.
  const std::shared_ptr<void> stopped(nullptr, [&](void*) { stop = true; });
  for (int i = 0; i < 30; ++i) {
    std::fflush(nullptr);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      alarm(60);  // one that waits for a lock of its parent's would do so for ever
      std::vector<float> made(expected_.size());
      const bool same = generate(made) == EVENTGAN_COMPLETE && made == expected_;
      eventgan_generator* own = nullptr;
      const bool loads =
          eventgan_load(R"({"generator": {"weights": "untrained:2"}})", &own) == EVENTGAN_COMPLETE;
      eventgan_free(own);
      _exit(same && loads ? 0 : 1);
    }
    int status = -1;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_EQ(status, 0) << "fork " << i;
  }
  stop = true;
  threads.clear();
  EXPECT_EQ(wrong, 0);
}

TEST_F(Calls, AProcessEndsWhileItsThreadsCall) {
  for (int i = 0; i < 5; ++i) {
    std::fflush(nullptr);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      alarm(60);
      std::atomic<bool> stop = false;
      std::atomic<int> wrong = 0;
      for (int k = 0; k < 3; ++k) std::thread([&] { call_on(stop, wrong); }).detach();
      std::this_thread::sleep_for(std::chrono::milliseconds(20 * (i + 1)));
      eventgan_end();
      std::vector<float> made(expected_.size());
      if (generate(made) != EVENTGAN_COMPLETE || made != expected_ || wrong > 0) _exit(1);
      std::exit(0);
    }
    int status = -1;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_EQ(status, 0) << "end " << i;
  }
}

}  // namespace
