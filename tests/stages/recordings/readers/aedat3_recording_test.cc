#include "stages/recordings/readers/detail/aedat3_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan::aedat3 {
namespace {

using ::testing::HasSubstr;
using testing::texts_with;

const std::string kHeader =
    "#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n#Source 2: DVS128\r\n"
    "#Start-Time: 2017-03-01 12:00:00 (TZ+0100)\r\n#!END-HEADER\r\n";

template <class Number>
std::string raw(Number number) {
  return {reinterpret_cast<const char*>(&number), sizeof(number)};
}

struct TestPacket {
  std::uint16_t type = 1;
  std::uint32_t event_bytes = 8;
  std::vector<std::string> events = {};
  std::uint32_t overflows = 0;
  std::uint16_t source = 1;

  std::string bytes() const {
    const auto count = static_cast<std::uint32_t>(events.size());
    std::string result = raw(type) + raw(source) + raw(event_bytes) + raw(std::uint32_t{4}) +
                         raw(overflows) + raw(count) + raw(count) + raw(count);
    for (const std::string& event : events) result += event;
    return result;
  }
};

std::string event(std::uint32_t x, std::uint32_t y, std::uint32_t t_us, std::uint32_t on,
                  std::uint32_t valid = 1) {
  return raw(x << 17 | y << 2 | on << 1 | valid) + raw(t_us);
}

/// 240x180 of one colour, whose upper bytes these are.
std::string frame(std::int32_t begin_us, std::int32_t end_us, const std::string& colour,
                  std::int32_t width = 240, std::uint32_t valid = 1) {
  std::string result = raw(static_cast<std::uint32_t>(colour.size()) << 1 | valid);
  for (const std::int32_t number : {1, 2, begin_us, end_us, width, 180, 0, 0}) {
    result += raw(number);
  }
  for (int i = 0; i < width * 180; ++i) {
    for (const char value : colour) result += {'\x7f', value};
  }
  return result;
}

class Aedat3 : public ::testing::Test {
 protected:
  std::unique_ptr<Recording> open(const std::string& bytes, const RecordingOptions& options = {}) {
    testing::write_file(path_, bytes);
    return open_recording(path_, std::nullopt, options);
  }
  static std::vector<Event> all(const Recording& recording) { return recording.events_in(-1, 1e6); }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "a.aedat";
};

TEST_F(Aedat3, ReadsEventsOfOneSource) {
  constexpr double kOverflow_s = 2147.483648;  // 2^31 µs
  const std::string first =
      TestPacket{.events = {event(0, 0, 5, 1), event(9, 9, 6, 1, 0), event(239, 179, 7, 0)}}
          .bytes();
  const std::string later = TestPacket{.events = {event(1, 2, 0, 1)}, .overflows = 1}.bytes();
  const std::string others = TestPacket{.events = {event(127, 1, 9, 1)}, .source = 2}.bytes();
  const std::string special = TestPacket{.type = 0, .events = {std::string(8, 'x')}}.bytes();
  const std::string imu =
      TestPacket{.type = 3, .event_bytes = 36, .events = {std::string(36, 'x')}}.bytes();
  const Event a{0, 0, 5e-6, true}, b{239, 179, 7e-6, false}, c{1, 2, kOverflow_s, true},
      d{127, 1, 9e-6, true};
  const struct {
    std::string packets;
    std::optional<int> stream;
    ImageSize size;
    std::vector<Event> events;
    std::vector<std::string> notes;
  } cases[] = {
      {first + later, {}, {180, 240}, {a, b, c}, {"events marked invalid are left out: 1, in "}},
      {special + first + imu + imu,
       {},
       {180, 240},
       {a, b},
       {"events of type 0 are passed over: 1", "events of type 3 are passed over: 2", "invalid"}},
      {others + first,
       {},
       {180, 240},
       {a, b},
       {"of several sources of events (1, 2) the first is taken", "invalid"}},
      {others + first, 2, {128, 128}, {d}, {}},
      {others, {}, {128, 128}, {d}, {}},
      {others + later.substr(0, 30),
       {},
       {128, 128},
       {d},
       {"the last packet is cut off and left out: expected a packet of 36 bytes, got 30"}},
      {others + later.substr(0, 3), {}, {128, 128}, {d}, {"expected a packet of 28 bytes, got 3"}},
      {others + TestPacket{.source = 2}.bytes(), {}, {128, 128}, {d}, {}}};
  for (const auto& [packets, stream, size, events, notes] : cases) {
    RecordingOptions options;
    options.stream = stream;
    const auto recording = open(kHeader + packets, options);
    EXPECT_EQ(find_recording_format(path_), RecordingFormat::kAedat3);
    EXPECT_EQ(recording->size(), size);
    EXPECT_EQ(all(*recording), events);
    ASSERT_EQ(recording->notes().size(), notes.size());
    for (std::size_t i = 0; i < notes.size(); ++i) {
      EXPECT_THAT(recording->notes()[i], HasSubstr(notes[i]));
    }
  }
}

TEST_F(Aedat3, ReadsLongPacketsInParts) {
  TestPacket packet;
  constexpr std::uint32_t kEvents = 300'000;
  for (std::uint32_t i = 0; i < kEvents; ++i) packet.events.push_back(event(i % 240, 1, i, 1));
  const auto recording = open(kHeader + packet.bytes());
  EXPECT_EQ(all(*recording).size(), kEvents);
  EXPECT_EQ(recording->events_in(0.299998, 1),
            (std::vector<Event>{{(kEvents - 1) % 240, 1, 0.299999, true}}));
}

TEST_F(Aedat3, ReadsFrames) {
  const std::uint32_t one = 36 + 2 * 240 * 180, three = 36 + 6 * 240 * 180;
  const TestPacket grey{2, one, {frame(10, 15, "\x07"), frame(30, 31, "\x08")}};
  // red 10, green 100, blue 50: 0.299 · 10 + 0.587 · 100 + 0.114 · 50 = 67.39
  const TestPacket colour{2, three, {frame(40, 42, "\x0a\x64\x32")}, 1};  // times overflow
  const TestPacket bad{2,
                       one,
                       {frame(50, 51, "\x07", 239) + std::string(360, 'x'),
                        frame(50, 51, "\x07", 240, 0), frame(5, 4, "\x07"), frame(20, 21, "\x07")}};
  const auto recording = open(kHeader + TestPacket{.events = {event(0, 0, 20, 1)}}.bytes() +
                              grey.bytes() + bad.bytes() + colour.bytes());
  ASSERT_EQ(recording->frame_count(), 3);
  EXPECT_EQ(recording->frame_time_s(0), 12e-6);
  EXPECT_EQ(recording->frame_time_s(2), (0x80000000u + 41) / 1e6);
  const std::pair<int, int> greys[] = {{0, 7}, {1, 8}, {2, 67}};
  for (const auto& [index, value] : greys) {
    EXPECT_EQ(recording->frame(index).pixels,
              std::vector<std::uint8_t>(240 * 180, static_cast<std::uint8_t>(value)));
  }
  EXPECT_EQ(recording->events_between(0, 1).size(), 1u);
  EXPECT_THAT(recording->notes(),
              texts_with({{"frames in colour are made grey"},
                          {"of frames of 16 bits the upper 8 are taken"},
                          {"frames left out: 4 (the first: expected a frame of 240x180 at 0, 0, "
                           "got 239x180 at 0, 0"}}));
}

TEST_F(Aedat3, RefusesWhatItCannotRead) {
  const std::string one = TestPacket{.events = {event(0, 0, 5, 1)}}.bytes();
  const std::pair<std::string, std::string> cases[] = {
      {"#!AER-DAT2.0\r\n", "got AEDAT of another version than 3.1 and 4.0"},
      {"#!AER-DAT3.1", "expected a line of text, got no end of it"},
      {"#!AER-DAT3.1\r\n#!END-HEADER\r\n" + one, "expected the sensor's size"},
      {kHeader + one.substr(0, 30), "expected a packet of 36 bytes, got 30"},
      {kHeader + TestPacket{.type = 0x8001}.bytes(), "got packed ones"},
      {kHeader + TestPacket{.event_bytes = 9}.bytes(), "of type 1 with events of 9 bytes"},
      {kHeader + TestPacket{.type = 2}.bytes(), "of type 2 with events of 8 bytes"},
      {kHeader + TestPacket{.type = 5, .event_bytes = 0}.bytes(), "with events of 0 bytes"},
      {kHeader + TestPacket{.overflows = 1u << 30}.bytes(), "1073741824 overflows"},
      {kHeader + TestPacket{.events = {event(0, 0, 1u << 31, 1)}}.bytes(), "a time of 31 bits"}};
  for (const auto& [bytes, fault] : cases) EXPECT_THROWS(open(bytes), InputError, fault);
  RecordingOptions options;
  options.stream = 3;
  EXPECT_THROWS(open(kHeader + one, options), InputError,
                "expected the manifest's \"stream\" to be a source of events, 1, got 3");
}

TEST_F(Aedat3, WithoutEventsIsAStillScene) {
  const auto recording = open(kHeader, {.sensor = ImageSize{3, 4}});
  EXPECT_EQ(recording->size(), (ImageSize{3, 4}));
  EXPECT_EQ(recording->event_span(), std::nullopt);
}

}  // namespace
}  // namespace eventgan::aedat3
