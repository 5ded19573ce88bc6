#include "stages/recordings/order/event_index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr int kEvents = 100'000;

/// Event i at i µs, but one fall in the middle and a small step back, which is lifted, before it.
std::int64_t time_us(int i) { return i == kEvents / 2 ? i - 2001 : i == kEvents / 4 ? i - 10 : i; }

class EventIndexesTest : public ::testing::Test {
 protected:
  EventIndexesTest() {
    std::string dat = "% Data file containing CD events.\n% Version 2\n% Height 4\n% Width 8\n";
    dat.append({0x0c, 8});
    std::string text;
    using Values = std::vector<std::int64_t>;
    Values x, y, t, p;
    for (int i = 0; i < kEvents; ++i) {
      const std::array<std::uint32_t, 2> words{static_cast<std::uint32_t>(time_us(i)),
                                               static_cast<std::uint32_t>(i % 8 | i % 4 << 14)};
      dat.append(reinterpret_cast<const char*>(words.data()), sizeof(words));
      x.push_back(i % 8);
      y.push_back(i % 4);
      t.push_back(time_us(i));
      p.push_back(0);
      text += "0." + std::to_string(1'000'000 + time_us(i)).substr(1) + " " +
              std::to_string(i % 8) + " " + std::to_string(i % 4) + " 0\n";
    }
    testing::write_file(folder_ / "a.dat", dat);
    const std::uint64_t count = kEvents;
    testing::write_hdf5(folder_ / "a.h5", {{"events/x", {{count}, x}},
                                           {"events/y", {{count}, y}},
                                           {"events/t", {{count}, t}},
                                           {"events/p", {{count}, p}},
                                           {"events/height", {{}, Values{4}}},
                                           {"events/width", {{}, Values{8}}}});
    testing::write_file(folder_ / "ecd/events.txt", text);
    testing::write_file(folder_ / "ecd/images.txt", "0 0.pgm\n1 0.pgm\n");
    testing::write_file(folder_ / "ecd/0.pgm", "P5 8 4 255\n" + std::string(32, 'a'));
  }

  /// What a recording of the events gives: its span, a window and a fault.
  void check(const char* name) const {
    const auto recording = open_recording(folder_ / name);
    EXPECT_EQ(recording->event_span(), (std::array{0.0, (kEvents - 1) / 1e6})) << name;
    const std::vector<Event> window = recording->events_in(9.5e-6, 20e-6);
    ASSERT_EQ(window.size(), 11u) << name;
    for (int i = 0; i < 11; ++i) {
      EXPECT_EQ(window[static_cast<std::size_t>(i)],
                (Event{(10 + i) % 8, (10 + i) % 4, (10 + i) / 1e6, false}));
    }
    EXPECT_EQ(recording->events_in(0.09, 1).size(), 9999u) << name;
    EXPECT_THROWS(recording->events_in(0.0499, 0.051), InputError,
                  "expected times that never decrease");
    if (std::string_view(name) == "ecd") return;
    EXPECT_EQ(recording->events_in(0.02, 0.03)[4999].t_s, 0.024999) << name;
    EXPECT_THAT(recording->notes(),
                ::testing::Contains(::testing::HasSubstr("1 is lifted to the latest")))
        << name;
  }

  /// How many bytes of a file it reads.
  std::uint64_t bytes_read(const char* name, const char* file) const {
    const InputCounter counter;
    check(name);
    return counter.of(folder_ / file).bytes;
  }

  testing::TemporaryFolder folder_;
  fs::path index_ = folder_ / "plan.index";
};

TEST_F(EventIndexesTest, WhatWasReadIsNotReadAgain) {
  {
    EventIndexes indexes(index_);
    for (const char* name : {"a.dat", "a.h5", "ecd"}) check(name);
    indexes.save();
  }
  const std::string saved = testing::read_file(index_);
  EXPECT_LT(saved.size(), 5000u);
  for (int turn = 0; turn < 2; ++turn) {
    EventIndexes indexes(index_);
    check("a.h5");
    // Three windows of blocks of 128 and 64 KiB, and the line of the fault.
    EXPECT_LT(bytes_read("a.dat", "a.dat"), fs::file_size(folder_ / "a.dat") * 7 / 10);
    indexes.save();
    EXPECT_EQ(testing::read_file(index_), saved);  // nothing is new
  }
  EXPECT_EQ(EventIndexes::current(), nullptr);
  EXPECT_GT(bytes_read("a.dat", "a.dat"), fs::file_size(folder_ / "a.dat"));
}

TEST_F(EventIndexesTest, OfAFileThatHasChangedAllIsReadAgain) {
  {
    EventIndexes indexes(index_);
    check("a.dat");
    check("a.h5");
    indexes.save();
  }
  std::string dat = testing::read_file(folder_ / "a.dat");
  dat[dat.size() - 8 * kEvents + 1] = 9;  // the first event's time is 9 * 256 µs
  testing::write_file(folder_ / "a.dat", dat);
  fs::last_write_time(folder_ / "a.dat",
                      fs::last_write_time(folder_ / "a.h5") + std::chrono::seconds(5));
  EventIndexes indexes(index_);
  EXPECT_THROWS(open_recording(folder_ / "a.dat")->events_in(0, 1e-5), InputError,
                "expected times that never decrease");
  indexes.save();
  EXPECT_EQ(testing::read_file(index_).find("a.h5"), std::string::npos);  // nobody asked for it
  EXPECT_NE(testing::read_file(index_).find("a.dat"), std::string::npos);
}

TEST_F(EventIndexesTest, ADamagedFileIsAsNone) {
  {
    EventIndexes indexes(index_);
    for (const char* name : {"a.dat", "a.h5", "ecd"}) check(name);
    indexes.save();
  }
  const std::string sound = testing::read_file(index_);
  for (std::size_t at = 0; at < sound.size(); at += 97) {
    std::string damaged = sound;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    testing::write_file(index_, damaged);
    EXPECT_EQ(EventIndexes(index_).find(event_index_key(folder_ / "a.h5", "events/t")),
              std::nullopt);
    testing::write_file(index_, sound.substr(0, at));
    EventIndexes cut(index_);
    EXPECT_EQ(cut.find(event_index_key(folder_ / "a.h5", "events/t")), std::nullopt);
  }
  EventIndexes indexes(folder_ / "absent/plan.index");
  check("a.dat");
  indexes.save();  // there is no such folder
}

TEST_F(EventIndexesTest, OfOtherOptionsAllIsReadAgain) {
  EventIndexes indexes(index_);
  check("a.dat");
  RecordingOptions small;
  small.sensor = ImageSize{4, 3};
  const auto recording = open_recording(folder_ / "a.dat", std::nullopt, small);
  EXPECT_EQ(recording->events_in(9.5e-6, 20e-6).size(), 4u);  // x of 10 % 8 = 2, and 16 to 18
}

}  // namespace
}  // namespace eventgan
