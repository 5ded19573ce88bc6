#include "stages/recordings/writers/evt3_writer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/recordings/readers/recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::TemporaryFolder;

bool same(const StampedEvent& a, const StampedEvent& b) {
  return a.t_us == b.t_us && a.x == b.x && a.y == b.y && a.positive == b.positive;
}

std::vector<unsigned> words_of(const std::string& bytes) {
  constexpr std::string_view kEnd = "% end\n";
  std::vector<unsigned> words;
  for (std::size_t i = bytes.find(kEnd) + kEnd.size(); i + 1 < bytes.size(); i += 2) {
    words.push_back(static_cast<unsigned char>(bytes[i]) |
                    unsigned{static_cast<unsigned char>(bytes[i + 1])} << 8);
  }
  return words;
}

/// As the format's page describes it, and OpenEB reads it: the upper bits have wrapped where they
/// fall by half of their range.
std::vector<StampedEvent> decode(const std::vector<unsigned>& words) {
  std::vector<StampedEvent> events;
  std::int64_t wraps = 0, high = 0, low = 0;
  std::uint16_t y = 0;
  for (const unsigned word : words) {
    const std::int64_t value = word & 0xfff;
    switch (word >> 12) {
      case 0x8:
        if (high >= value + 2048) ++wraps;
        if (high != value) low = 0;
        high = value;
        break;
      case 0x6:
        low = value;
        break;
      case 0x0:
        y = static_cast<std::uint16_t>(value & 0x7ff);
        break;
      case 0x2:
        events.push_back({(wraps << 24) + (high << 12) + low,
                          static_cast<std::uint16_t>(value & 0x7ff), y, (value >> 11) != 0});
        break;
      default:
        ADD_FAILURE() << "a word of type " << (word >> 12);
    }
  }
  return events;
}

TEST(Evt3Writer, WritesWhatHasChanged) {
  const TemporaryFolder folder;
  Evt3Writer writer(folder / "a.raw", {480, 640});
  // The lower bits go with each of the upper ones: for readers these begin at 0.
  const std::vector<StampedEvent> events{{0, 7, 3, true},
                                         {0, 8, 3, false},
                                         {4097, 639, 479, true},
                                         {4097, 0, 479, true},
                                         {8193, 0, 479, true}};
  writer.add_events(events);
  writer.commit(9096);
  const std::string bytes = testing::read_file(folder / "a.raw");
  EXPECT_NE(bytes.find("\n% format EVT3;height=480;width=640\n"), std::string::npos);
  EXPECT_EQ(words_of(bytes),
            (std::vector<unsigned>{0x8000, 0x6000, 0x0003, 0x2807, 0x2008, 0x8001, 0x6001, 0x01df,
                                   0x2a7f, 0x2800, 0x8002, 0x6001, 0x2800, 0x6388}));
}

TEST(Evt3Writer, IsReadBackEventForEventOverWrapsAndSilence) {
  const TemporaryFolder folder;
  std::mt19937 random(5);
  std::vector<StampedEvent> events;
  std::int64_t t_us = 0;
  for (int i = 0; i < 3000; ++i) {
    t_us += i % 1000 == 999 ? 40'000'000 : static_cast<std::int64_t>(random() % 9000);
    events.push_back({t_us, static_cast<std::uint16_t>(random() % 2048),
                      static_cast<std::uint16_t>(random() % 1000), random() % 2 == 0});
  }
  const auto write = [&](const char* name, std::size_t at_once) {
    Evt3Writer writer(folder / name, {1000, 2048});
    for (std::size_t i = 0; i < events.size(); i += at_once) {
      writer.add_events(std::span(events).subspan(i, std::min(at_once, events.size() - i)));
    }
    writer.commit(t_us);
    return testing::read_file(folder / name);
  };
  const std::string bytes = write("a.raw", 1);
  EXPECT_EQ(bytes, write("b.raw", events.size()));
  EXPECT_TRUE(std::ranges::equal(decode(words_of(bytes)), events, same));

  const auto recording = open_recording(folder / "a.raw", RecordingFormat::kProphesee, {});
  EXPECT_EQ(recording->size(), (ImageSize{1000, 2048}));
  const auto read = recording->events_in(-1, static_cast<double>(t_us) * 1e-6 + 1);
  ASSERT_EQ(read.size(), events.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_NEAR(read[i].t_s, static_cast<double>(events[i].t_us) * 1e-6, 1e-9);
    EXPECT_TRUE(read[i].x == events[i].x && read[i].y == events[i].y &&
                read[i].positive == events[i].positive);
  }
}

TEST(Evt3Writer, OfNoEventsTellsItsEndAlone) {
  const TemporaryFolder folder;
  Evt3Writer writer(folder / "a.raw", {1, 1});
  writer.commit(8192);
  EXPECT_EQ(words_of(testing::read_file(folder / "a.raw")),
            (std::vector<unsigned>{0x8000, 0x8001, 0x8002, 0x6000}));
}

TEST(Evt3Writer, RefusesWhatTheFormatDoesNotHold) {
  const TemporaryFolder folder;
  for (const ImageSize size : {ImageSize{0, 5}, {5, 0}, {2049, 5}, {5, 2049}}) {
    EXPECT_THROWS(Evt3Writer(folder / "a.raw", size), std::invalid_argument,
                  "expected a sensor of 1 to 2048 pixels a side for EVT 3.0");
  }
  Evt3Writer writer(folder / "a.raw", {4, 6});
  const std::vector<StampedEvent> in_order{{50, 5, 3, true}};
  writer.add_events(in_order);
  for (const auto& [wrong, words] :
       {std::pair(StampedEvent{49, 0, 0, true}, "events in time order"),
        {{50, 6, 0, true}, "events within the size"},
        {{50, 0, 4, true}, "events within the size"}}) {
    EXPECT_THROWS(writer.add_events(std::span(&wrong, 1)), std::invalid_argument, words);
  }
  EXPECT_THROWS(writer.commit(49), std::invalid_argument,
                "an end that is not before the last event");
  writer.commit(50);
  EXPECT_EQ(decode(words_of(testing::read_file(folder / "a.raw"))).size(), 1U);
}

}  // namespace
}  // namespace eventgan
