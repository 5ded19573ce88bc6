#include "stages/recordings/writers/aedat4_writer.h"

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

std::unique_ptr<Recording> open(const std::filesystem::path& file) {
  return open_recording(file, RecordingFormat::kAedat4, {});
}

TEST(Aedat4Writer, IsReadBackEventForEventAndFrameForFrame) {
  const TemporaryFolder folder;
  constexpr ImageSize kSize{5, 300};
  constexpr int kFrameCount = 6, kBetween = 9000;  // more events than one packet has
  std::mt19937 random(3);
  std::vector<StampedEvent> events;
  std::vector<GreyImage> frames;
  for (int frame = 0; frame < kFrameCount; ++frame) {
    for (int i = 0; i < kBetween; ++i) {
      events.push_back({1'600'000'000'000'000 + frame * 50'000 + i * 5,
                        static_cast<std::uint16_t>(random() % 300),
                        static_cast<std::uint16_t>(random() % 5), random() % 2 == 0});
    }
    frames.push_back({kSize, {}});
    for (std::size_t i = 0; i < kSize.pixel_count(); ++i) {
      frames.back().pixels.push_back(static_cast<std::uint8_t>(random()));
    }
  }
  const auto frame_us = [](int frame) { return 1'600'000'000'000'000 + (frame + 1) * 50'000; };
  const auto write = [&](const char* name, std::size_t at_once) {
    Aedat4Writer writer(folder / name, kSize);
    for (int frame = 0; frame < kFrameCount; ++frame) {
      const auto between =
          std::span(events).subspan(static_cast<std::size_t>(frame) * kBetween, kBetween);
      for (std::size_t i = 0; i < between.size(); i += at_once) {
        writer.add_events(between.subspan(i, std::min(at_once, between.size() - i)));
      }
      writer.add_frame(frame_us(frame), frames[static_cast<std::size_t>(frame)].pixels);
    }
    EXPECT_FALSE(std::filesystem::exists(folder / name));
    writer.commit();
    return testing::read_file(folder / name);
  };
  EXPECT_EQ(write("a.aedat4", 7), write("b.aedat4", 100'000));

  const auto recording = open(folder / "a.aedat4");
  EXPECT_TRUE(recording->notes().empty());
  EXPECT_EQ(recording->size(), kSize);
  ASSERT_EQ(recording->frame_count(), kFrameCount);
  for (int frame = 0; frame < kFrameCount; ++frame) {
    EXPECT_DOUBLE_EQ(recording->frame_time_s(frame), static_cast<double>(frame_us(frame)) / 1e6);
    EXPECT_EQ(recording->frame(frame), frames[static_cast<std::size_t>(frame)]);
  }
  const auto read = recording->events_in(0, 2e9);
  ASSERT_EQ(read.size(), events.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    ASSERT_TRUE(read[i] == (Event{events[i].x, events[i].y,
                                  static_cast<double>(events[i].t_us) / 1e6, events[i].positive}));
  }
}

TEST(Aedat4Writer, KeepsColour) {
  const TemporaryFolder folder;
  Aedat4Writer writer(folder / "a.aedat4", {1, 2});
  writer.add_frame(0, std::vector<std::uint8_t>{10, 100, 200, 9, 9, 9});
  writer.commit();
  const auto recording = open(folder / "a.aedat4");
  // ITU-R BT.601: 0.114 * 10 + 0.587 * 100 + 0.299 * 200 = 119.64.
  EXPECT_EQ(recording->frame(0).pixels, (std::vector<std::uint8_t>{120, 9}));
}

TEST(Aedat4Writer, OfNothingIsARecordingWithoutEvents) {
  const TemporaryFolder folder;
  Aedat4Writer(folder / "a.aedat4", {7, 9}).commit();
  const auto recording = open(folder / "a.aedat4");
  EXPECT_EQ(recording->size(), (ImageSize{7, 9}));
  EXPECT_EQ(recording->frame_count(), 0);
  EXPECT_EQ(recording->event_span(), std::nullopt);
}

TEST(Aedat4Writer, RefusesWhatTheFormatDoesNotHold) {
  const TemporaryFolder folder;
  for (const ImageSize size : {ImageSize{0, 5}, {5, 0}, {32768, 5}, {5, 32768}}) {
    EXPECT_THROWS(Aedat4Writer(folder / "a.aedat4", size), std::invalid_argument,
                  "expected a sensor of 1 to 32767 pixels a side for AEDAT 4.0");
  }
  Aedat4Writer writer(folder / "a.aedat4", {1, 2});
  const std::vector<std::uint8_t> grey{1, 2}, more{1, 2, 3};
  writer.add_frame(40, grey);
  writer.add_events(std::vector<StampedEvent>{{50, 1, 0, true}});
  for (const auto& [wrong, words] :
       {std::pair(StampedEvent{49, 0, 0, true}, "events in time order"),
        {{50, 2, 0, true}, "events within the size"},
        {{50, 0, 1, true}, "events within the size"}}) {
    EXPECT_THROWS(writer.add_events(std::span(&wrong, 1)), std::invalid_argument, words);
  }
  const char* const in_order = "expected a frame after the one before and not before any event";
  EXPECT_THROWS(writer.add_frame(49, grey), std::invalid_argument, in_order);
  EXPECT_THROWS(writer.add_frame(60, more), std::invalid_argument, "one or three channels");
  writer.add_frame(50, grey);
  EXPECT_THROWS(writer.add_frame(50, grey), std::invalid_argument, in_order);
  writer.commit();
  const auto recording = open(folder / "a.aedat4");
  EXPECT_EQ(recording->events_in(0, 1).size(), 1U);
  EXPECT_EQ(recording->frame_count(), 2);
}

}  // namespace
}  // namespace eventgan
