#include "stages/recordings/readers/detail/rosbag_recording.h"

#include <bzlib.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lz4frame.h>

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/recordings/order/event_index.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan::rosbag {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::texts_with;

// As genpy writes them, with some of the comments.
constexpr const char* kHeaderDefinition = R"(
================================================================================
MSG: std_msgs/Header
# Standard metadata for higher-level stamped data types.
uint32 seq
time stamp
string frame_id
)";
const std::string kArrayDefinition = std::string(R"(# This message contains an array of events
# (0, 0) is at top-left corner of image

Header header

uint32 height         # image height, that is, number of rows
uint32 width          # image width, that is, number of columns

# an array of events
Event[] events
)") + kHeaderDefinition + R"(
================================================================================
MSG: dvs_msgs/Event
# A DVS event
uint16 x
uint16 y
time ts
bool polarity
)";
const std::string kPacketDefinition = std::string(R"(Header header     # standard ROS header
uint32 height     # image height
uint32 width      # image width

uint64 seq        # sequence number to detect lost messages
uint64 time_base  # event ros time = time_base + decoded event_time
string encoding   # the encoding scheme to use
bool is_bigendian # true if machine stores in big endian format

uint8[] events
)") + kHeaderDefinition;
const std::string kImageDefinition = std::string(R"(std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
)") + kHeaderDefinition;

template <class Number>
std::string raw(Number number) {
  return {reinterpret_cast<const char*>(&number), sizeof(number)};
}

std::string text(const std::string& content) {
  return raw(static_cast<std::uint32_t>(content.size())) + content;
}

std::string fields(const std::map<std::string, std::string>& values) {
  std::string result;
  for (const auto& [name, value] : values) result += text(name + "=" + value);
  return result;
}

std::string record(const std::map<std::string, std::string>& header, const std::string& data) {
  return text(fields(header)) + text(data);
}

std::string op(std::uint8_t number) { return raw(number); }

std::string packed(const std::string& content, const std::string& compression) {
  if (compression == "none") return content;
  std::string result(2 * content.size() + 1024, '\0');
  if (compression == "lz4") {
    result.resize(
        LZ4F_compressFrame(result.data(), result.size(), content.data(), content.size(), nullptr));
    return result;
  }
  std::string input = content;
  auto size = static_cast<unsigned>(result.size());
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(result.data(), &size, input.data(),
                                     static_cast<unsigned>(input.size()), 9, 0, 0),
            BZ_OK);
  result.resize(size);
  return result;
}

// Messages; times in microseconds since kStart, a time of day.

constexpr std::uint32_t kStart_s = 1'500'000'000;

std::string stamp(int time_us, int ns = 0) {
  return raw(kStart_s + static_cast<std::uint32_t>(time_us / 1'000'000)) +
         raw(static_cast<std::uint32_t>(time_us % 1'000'000 * 1000 + ns));
}

double seconds(int time_us) { return (kStart_s * 1e6 + time_us) / 1e6; }

std::string start(int time_us, ImageSize size) {
  return raw(std::uint32_t{7}) + stamp(time_us) + text("camera") + raw(size.height) +
         raw(size.width);
}

struct TestEvent {
  int x = 0, y = 0, t_us = 0, polarity = 0;
  Event event() const { return {x, y, seconds(t_us), polarity == 1}; }
  bool operator==(const TestEvent&) const = default;
};

constexpr ImageSize kSize{3, 4};

std::string array(const std::vector<TestEvent>& events, ImageSize size = kSize) {
  std::string message = start(0, size) + raw(static_cast<std::uint32_t>(events.size()));
  for (const TestEvent& event : events) {
    message += raw(static_cast<std::uint16_t>(event.x)) + raw(static_cast<std::uint16_t>(event.y)) +
               stamp(event.t_us, 999) + raw(static_cast<std::uint8_t>(event.polarity));
  }
  return message;
}

std::string packet(const std::string& encoding, int stamp_us, std::uint64_t base_ns,
                   const std::string& words, bool big_endian = false) {
  return start(stamp_us, kSize) + raw(std::uint64_t{1}) + raw(base_ns) + text(encoding) +
         raw(big_endian) + text(words);
}

std::string mono(std::uint64_t x, std::uint64_t y, std::uint64_t after_ns, std::uint64_t on) {
  return raw(on << 63 | y << 48 | x << 32 | after_ns);
}

std::string evt3(const std::vector<std::uint16_t>& words) {
  std::string result;
  for (const std::uint16_t word : words) result += raw(word);
  return result;
}

std::string image(int time_us, const std::string& encoding, std::uint32_t row_bytes,
                  const std::string& data, ImageSize size = kSize) {
  return start(time_us, size) + text(encoding) + raw(std::uint8_t{0}) + raw(row_bytes) + text(data);
}

struct TestTopic {
  std::string name, type, definition;
};
const TestTopic kEvents{"/dvs/events", "dvs_msgs/EventArray", kArrayDefinition};
const TestTopic kPackets{"/dvs/events", "event_camera_msgs/EventPacket", kPacketDefinition};
const TestTopic kImages{"/dvs/image_raw", "sensor_msgs/Image", kImageDefinition};

struct TestMessage {
  std::size_t topic = 0;
  std::string content;
};

struct TestBag {
  std::vector<TestTopic> topics = {kEvents};
  std::vector<std::vector<TestMessage>> chunks;
  std::string compression = "none";
  bool has_index = true;

  std::string connection(std::size_t number) const {
    const TestTopic& topic = topics[number];
    return record(
        {{"op", op(7)}, {"conn", raw(static_cast<std::uint32_t>(number))}, {"topic", topic.name}},
        fields({{"topic", topic.name},
                {"type", topic.type},
                {"md5sum", "*"},
                {"message_definition", topic.definition}}));
  }

  std::string head(std::uint64_t index_at) const {
    const std::string header =
        fields({{"op", op(3)},
                {"index_pos", raw(index_at)},
                {"conn_count", raw(static_cast<std::uint32_t>(topics.size()))},
                {"chunk_count", raw(static_cast<std::uint32_t>(chunks.size()))}});
    return "#ROSBAG V2.0\n" + text(header) + text(std::string(4096 - 8 - header.size(), ' '));
  }

  /// Where each chunk begins, in bytes().
  std::vector<std::size_t> places() const {
    std::vector<std::size_t> result;
    bytes(&result);
    return result;
  }

  std::string bytes(std::vector<std::size_t>* places = nullptr) const {
    std::string result = head(0), infos;
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      std::string content;
      for (std::size_t k = 0; i == 0 && k < topics.size(); ++k) content += connection(k);
      std::map<std::uint32_t, std::uint32_t> counts;
      for (const TestMessage& message : chunks[i]) {
        const auto number = static_cast<std::uint32_t>(message.topic);
        ++counts[number];
        content +=
            record({{"op", op(2)}, {"conn", raw(number)}, {"time", stamp(0)}}, message.content);
      }
      std::string told;
      for (const auto& [number, count] : counts) told += raw(number) + raw(count);
      infos += record({{"op", op(6)},
                       {"ver", raw(std::uint32_t{1})},
                       {"chunk_pos", raw(static_cast<std::uint64_t>(result.size()))},
                       {"start_time", stamp(0)},
                       {"end_time", stamp(0)},
                       {"count", raw(static_cast<std::uint32_t>(counts.size()))}},
                      told);
      if (places) places->push_back(result.size());
      result += record({{"op", op(5)},
                        {"compression", compression},
                        {"size", raw(static_cast<std::uint32_t>(content.size()))}},
                       packed(content, compression));
      if (!has_index) continue;
      for (const auto& [number, count] : counts) {
        result += record({{"op", op(4)},
                          {"ver", raw(std::uint32_t{1})},
                          {"conn", raw(number)},
                          {"count", raw(count)}},
                         std::string(12 * count, '\0'));
      }
    }
    if (!has_index) return result;
    const std::string first = head(result.size());
    for (std::size_t k = 0; k < topics.size(); ++k) result += connection(k);
    result += infos;
    result.replace(0, first.size(), first);
    return result;
  }
};

const std::vector<TestEvent> kFirst{{0, 0, 10, 1}, {3, 2, 11, 0}};
const std::vector<TestEvent> kSecond{{1, 1, 20, 0}, {2, 2, 2'000'020, 1}};
const std::vector<TestEvent> kThird{{1, 0, 3'000'000, 1}, {2, 1, 3'000'005, 0}};

std::vector<Event> events_of(const std::vector<std::vector<TestEvent>>& parts) {
  std::vector<Event> result;
  for (const auto& part : parts) {
    for (const TestEvent& event : part) result.push_back(event.event());
  }
  return result;
}

class Rosbag : public ::testing::Test {
 protected:
  std::unique_ptr<Recording> open(const std::string& bytes, const RecordingOptions& options = {}) {
    testing::write_file(path_, bytes);
    return open_recording(path_, std::nullopt, options);
  }
  std::unique_ptr<Recording> open(const TestBag& bag, const RecordingOptions& options = {}) {
    return open(bag.bytes(), options);
  }
  static std::vector<Event> all(const Recording& recording) {
    return recording.events_in(seconds(-1), seconds(10'000'000));
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "a.bag";
};

/// Three chunks, the last but one of which has two messages.
TestBag three_chunks() {
  return {.chunks = {
              {{0, array(kFirst)}}, {{0, array({})}, {0, array(kSecond)}}, {{0, array(kThird)}}}};
}

TEST_F(Rosbag, ReadsEveryCompressionWithAndWithoutAnIndex) {
  for (const char* compression : {"none", "bz2", "lz4"}) {
    for (const bool has_index : {true, false}) {
      TestBag bag = three_chunks();
      bag.compression = compression;
      bag.has_index = has_index;
      const auto recording = open(bag);
      EXPECT_EQ(find_recording_format(path_), RecordingFormat::kRosbag);
      EXPECT_EQ(recording->size(), kSize);
      EXPECT_EQ(recording->frame_count(), 0);
      EXPECT_EQ(all(*recording), events_of({kFirst, kSecond, kThird})) << compression;
      EXPECT_EQ(recording->events_in(seconds(11), seconds(20)), std::vector{kSecond[0].event()});
      EXPECT_THAT(recording->event_span(),
                  ::testing::Optional(ElementsAre(seconds(10), seconds(3'000'005))));
      EXPECT_EQ(recording->notes().size(), has_index ? 0u : 1u);
    }
  }
}

TEST_F(Rosbag, LosesOnlyTheChunkThatIsDamaged) {
  using Change = std::function<void(std::string&, const std::vector<std::size_t>&)>;
  const struct {
    const char* name;
    const char* compression;
    bool has_index;
    Change change;
    std::vector<std::vector<TestEvent>> left;
    std::string note;
  } cases[] = {
      {"bytes of bzip2",
       "bz2",
       true,
       [](auto& bytes, const auto& at) { bytes.replace(at[1] + 120, 4, "BOOM"); },
       {kFirst, kThird},
       "left out: 1 (the first: expected a bzip2 stream, got damage"},
      {"bytes of LZ4",
       "lz4",
       false,
       [](auto& bytes, const auto& at) { bytes.replace(at[1] + 58, 4, "BOOM"); },
       {kFirst, kThird},
       "left out: 1 (the first: expected an LZ4 frame, got damage"},
      {"a message's length",
       "none",
       true,
       [](auto& bytes, const auto& at) { bytes[bytes.find("camera", at[1]) - 20] = 'B'; },
       {kFirst, kThird},
       "left out: 1 (the first: expected"},
      {"a count of events",
       "none",
       false,
       [](auto& bytes, const auto& at) { bytes[bytes.find("camera", at[1]) + 14] = 'B'; },
       {kFirst, kThird},
       "left out: 1 (the first: expected 66 events of 13 bytes, got 0 bytes"},
      {"a record's header",
       "none",
       true,
       [](auto& bytes, const auto& at) { bytes.replace(at[1], 4, "BOOM"); },
       {kFirst, kThird},
       "left out: 1 (the first: expected a record, got a header of"},
      {"a name of a compression",
       "none",
       true,
       [](auto& bytes, const auto& at) { bytes[bytes.find("none", at[1])] = 'm'; },
       {kFirst, kThird},
       "left out: 1 (the first: expected a chunk in none, bz2 or lz4, got mone"},
      {"a size",
       "lz4",
       true,
       [](auto& bytes, const auto& at) { ++bytes[bytes.find("size=", at[1]) + 5]; },
       {kFirst, kThird},
       "left out: 1 (the first: expected a chunk of"},
      {"the last is cut",
       "bz2",
       false,
       [](auto& bytes, const auto& at) { bytes.resize(at[2] + 90); },
       {kFirst, kSecond},
       "left out: 1 (the first: expected a chunk up to byte"},
      {"the last is cut in its header",
       "none",
       false,
       [](auto& bytes, const auto& at) { bytes.resize(at[2] + 10); },
       {kFirst, kSecond},
       "the last 10 bytes are left out: expected"},
      {"the last was not closed",
       "none",
       false,
       [](auto& bytes, const auto& at) { bytes.replace(at[2] + 45, 4, 4, '\0'); },
       {kFirst, kSecond},
       "bytes are left out: expected a chunk that was closed"},
      {"cut behind the index was written",
       "lz4",
       true,
       [](auto& bytes, const auto& at) { bytes.resize(at[2] + 90); },
       {kFirst, kSecond},
       "left out: 1 (the first: expected a chunk up to byte"},
      {"the index",
       "lz4",
       true,
       [](auto& bytes, const auto&) { bytes[bytes.find("chunk_count=") + 12] = 9; },
       {kFirst, kSecond, kThird},
       "no index that can be used"},
  };
  for (const auto& [name, compression, has_index, change, left, note] : cases) {
    TestBag bag = three_chunks();
    bag.compression = compression;
    bag.has_index = has_index;
    std::string bytes = bag.bytes();
    change(bytes, bag.places());
    const auto recording = open(bytes);
    EXPECT_THAT(recording->notes(), ::testing::Contains(HasSubstr(note))) << name;
    EXPECT_EQ(recording->events_in(seconds(0), seconds(10)), std::vector{kFirst[0].event()});
    if (left.back() == kSecond || left.size() == 3) {
      EXPECT_EQ(all(*recording), events_of(left)) << name;
    } else {  // nobody knows what was between the first and the third chunk
      EXPECT_THROWS(all(*recording), InputError, "in " + path_.string()) << name;
      EXPECT_EQ(recording->events_in(seconds(3'000'000), seconds(9'000'000)),
                std::vector{kThird[1].event()})
          << name;
    }
  }
}

TEST_F(Rosbag, TakesEventsThatAreLaidOutSoAndRefusesOthers) {
  TestTopic prophesee{"/cam/cd_events", "prophesee_event_msgs/EventArray", kArrayDefinition};
  prophesee.definition.replace(prophesee.definition.find("dvs_msgs"), 8, "prophesee_event_msgs");
  TestTopic others{"/celex", "celex5_msgs/EventArray", kArrayDefinition};
  others.definition += "uint16 brightness\n";
  const TestTopic imu{"/imu", "sensor_msgs/Imu", "Header header\n"};
  const TestTopic left{"/left/events", kEvents.type, kArrayDefinition};
  const TestTopic right{"/right/events", kEvents.type, kArrayDefinition};
  const TestTopic untold{"/dvs/events", kEvents.type, ""};
  const auto chosen = [](std::optional<int> stream) {
    RecordingOptions options;
    options.stream = stream;
    return options;
  };
  const struct {
    std::vector<TestTopic> topics;
    std::optional<int> stream;
    std::vector<std::vector<TestEvent>> events;  ///< none: it is refused
    std::string fault;
  } cases[] = {
      {{prophesee, imu, others}, {}, {kFirst}, ""},
      {{imu, prophesee}, {}, {kSecond}, ""},
      {{untold}, {}, {kFirst}, ""},
      {{right, left}, 0, {kSecond}, ""},
      {{right, left}, 1, {kFirst}, ""},
      {{left, left}, {}, {kFirst, kSecond}, ""},  // two nodes that speak on one topic
      {{right, left},
       {},
       {},
       "expected \"stream\" in the manifest to be the number of a topic of events (0 /left/events, "
       "1 /right/events), got none, in "},
      {{right, left}, 2, {}, "1 /right/events), got 2, in "},
      {{others, imu},
       {},
       {},
       "expected a topic of events (dvs_msgs/EventArray, event_camera_msgs/EventPacket), got "
       "/celex "
       "(celex5_msgs/EventArray), /imu (sensor_msgs/Imu), in "},
      {{}, {}, {}, "got none, in "}};
  for (const auto& [topics, stream, events, fault] : cases) {
    TestBag bag{.topics = topics, .chunks = {{}}};
    if (!topics.empty()) bag.chunks = {{{0, array(kFirst)}}};
    if (topics.size() > 1) bag.chunks[0].push_back({1, array(kSecond)});
    if (events.empty()) {
      EXPECT_THROWS(open(bag, chosen(stream)), InputError, fault);
    } else {
      EXPECT_EQ(all(*open(bag, chosen(stream))), events_of(events)) << topics[0].name;
    }
  }
}

TEST_F(Rosbag, CountsPacketsOnTheCamerasClockFromTheFirstStamp) {
  // 4 events: at 0x5001 µs, twice at 0x5003 µs, in the next packet at 0x6002 µs.
  const std::string first = evt3({0x8005, 0x6001, 0x0002, 0x2803, 0x6003, 0x0001, 0x3801, 0x5003});
  const std::string second = evt3({0x8006, 0x6002, 0x2000, 0x2007});  // one beside the sensor
  const std::vector<Event> evt3_events = {{3, 2, seconds(100), true},
                                          {1, 1, seconds(102), true},
                                          {2, 1, seconds(102), true},
                                          {0, 1, seconds(100 + 0x1001), false}};
  const struct {
    std::vector<std::vector<TestMessage>> chunks;
    std::vector<Event> events;
    testing::TextMatcher note;
  } cases[] = {
      {{{{0, packet("evt3", 100, 0, first)}}, {{0, packet("evt3", 9'000'000, 5, second)}}},
       evt3_events,
       HasSubstr("events beside the sensor are left out: 1")},
      {{{{0, packet("evt3", 100, 0, first)}, {0, packet("evt3", 9'000'000, 5, second)}}},
       evt3_events,
       HasSubstr("events beside the sensor are left out: 1")},
      {{{{0, packet("mono", 50, 7'000'000'000, mono(3, 2, 1'500, 1) + mono(0, 1, 9'900, 0))}},
        {{0, packet("mono", 60, 7'000'020'000, mono(1, 1, 0, 1))}}},
       // the first is at 50 µs; the others 8.4 and 18.5 µs behind it
       {{3, 2, seconds(50), true}, {0, 1, seconds(58), false}, {1, 1, seconds(68), true}},
       HasSubstr("")},
  };
  for (const auto& [chunks, events, note] : cases) {
    const auto recording = open(TestBag{.topics = {kPackets}, .chunks = chunks});
    EXPECT_EQ(all(*recording), events);
    // The last alone: what the packet before has said is known.
    EXPECT_EQ(open_recording(path_)->events_in(events.back().t_s - 1e-6, events.back().t_s),
              std::vector{events.back()});
    EXPECT_THAT(recording->notes(), ::testing::Each(note));
  }
  const std::pair<std::string, std::string> refused[] = {
      {packet("libcaer_cmp", 0, 0, "abc"), "an EventPacket in evt3 or mono, got libcaer_cmp"},
      {packet("mono", 0, 0, "12345678", true), "evt3 or mono, got mono, big-endian"},
      {packet("mono", 0, 0, "12345678").substr(0, 9), "expected 4 bytes, got 1, in"}};
  for (const auto& [message, fault] : refused) {
    EXPECT_THROWS(open(TestBag{.topics = {kPackets}, .chunks = {{{0, message}}}}), InputError,
                  fault);
  }
}

TEST_F(Rosbag, TakesTheFramesOfTheCamerasTopic) {
  const TestTopic another{"/cam/image_raw", kImages.type, kImageDefinition};
  const TestTopic rendered{"/dvs/a", kImages.type, kImageDefinition};
  const TestTopic jpeg{"/dvs/image_raw/compressed", "sensor_msgs/CompressedImage",
                       "Header header\nstring format\nuint8[] data\n"};
  std::string padded;  // 12 pixels 0, 1, ... in rows of 6 bytes
  for (char y = 0; y < 3; ++y) {
    for (char x = 0; x < 6; ++x) padded += x < 4 ? static_cast<char>(4 * y + x) : 'x';
  }
  const std::vector<std::uint8_t> ramp{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  std::string bgr, rgb;  // 36 bytes
  for (int i = 0; i < 12; ++i) {
    bgr += {'\xc8', '\x64', '\x0a'};  // blue 200, green 100, red 10
    rgb += {'\x0a', '\x64', '\xc8'};
  }
  // 0.114 · 200 + 0.587 · 100 + 0.299 · 10 = 84.49
  const std::vector<std::uint8_t> grey(12, 84);
  const TestBag bag{
      .topics = {kEvents, kImages, another, rendered, jpeg},
      .chunks = {{{1, image(5, "mono8", 6, padded)}, {2, image(1, "mono8", 4, padded)}},
                 {{0, array(kFirst)}, {1, image(15, "bgr8", 12, bgr)}},
                 {{1, image(25, "rgb8", 12, rgb)}, {3, image(3, "mono8", 6, padded)}},
                 {{1, image(25, "mono8", 6, padded)},
                  {1, image(26, "bayer_rggb8", 4, padded)},
                  {1, image(27, "mono8", 4, padded, {3, 3})},
                  {1, image(28, "mono8", 6, "short")},
                  {1, "short"},
                  {4, "short"}}}};
  const auto recording = open(bag);
  ASSERT_EQ(recording->frame_count(), 3);
  EXPECT_EQ(recording->frame_time_s(0), seconds(5));
  EXPECT_EQ(recording->frame_time_s(2), seconds(25));
  EXPECT_EQ(recording->frame(0).pixels, ramp);
  EXPECT_EQ(recording->frame(1).pixels, grey);
  EXPECT_EQ(recording->frame(2).pixels, grey);
  EXPECT_EQ(recording->events_between(0, 1), events_of({kFirst}));
  EXPECT_THAT(recording->notes(),
              texts_with({{"images of other topics than the camera's /dvs/events are left out: "
                           "/cam/image_raw, /dvs/a, /dvs/image_raw/compressed, in "},
                          {"frames in colour are made grey"},
                          {"frames left out: 5 (the first: expected a frame after"}}));

  const std::pair<TestMessage, std::string> left_out[] = {
      {{1, image(1, "bayer_rggb8", 4, padded)},
       "expected a frame of 4x3 in mono8, bgr8 or rgb8, got 4x3 in bayer_rggb8"},
      {{1, image(1, "mono8", 3, padded, {3, 3})},
       "expected a frame of 4x3 in mono8, bgr8 or rgb8, got 3x3 in mono8"},
      {{1, image(1, "mono8", 4, "short")}, "expected 3 rows of 4 bytes, got 5 bytes of rows of 4"},
      {{1, image(1, "rgb8", 4, padded)}, "expected 3 rows of 12 bytes, got 18 bytes of rows of 4"}};
  for (const auto& [message, reason] : left_out) {
    const auto without =
        open(TestBag{.topics = {kEvents, kImages}, .chunks = {{message, {0, array(kFirst)}}}});
    EXPECT_EQ(without->frame_count(), 0);
    EXPECT_EQ(all(*without), events_of({kFirst}));
    EXPECT_THAT(without->notes(), texts_with({{"frames left out: 1 (the first: " + reason},
                                              {"are left out: /dvs/image_raw, in "}}));
  }
}

TEST_F(Rosbag, TakesTheSizeOfTheFirstMessage) {
  const std::vector<TestEvent> beside{{4, 0, 1, 1}, {0, 0, 2, 1}, {0, 3, 3, 1}};
  const struct {
    std::vector<TestMessage> messages;
    std::optional<ImageSize> sensor;
    std::string got;  ///< size and events, or the fault
  } cases[] = {{{{0, array(beside)}}, {}, "4x3: 1"},
               {{{0, array(beside)}}, ImageSize{4, 5}, "5x4: 3"},
               {{{0, array({}, {2, 2})}, {0, array(beside)}}, {}, "2x2: 1"},
               {{{0, array(beside, {0, 0})}}, ImageSize{3, 4}, "4x3: 1"},
               {{{0, array(beside, {0, 0})}}, {}, "expected the sensor's size in the file"},
               {{{0, array({})}}, {}, "4x3: 0"},
               {{}, ImageSize{3, 4}, "4x3: 0"},
               {{}, {}, "expected the sensor's size in the file"}};
  for (const auto& [messages, sensor, got] : cases) {
    RecordingOptions options;
    options.sensor = sensor;
    const TestBag bag{.chunks = {messages}};
    if (got.starts_with("expected")) {
      EXPECT_THROWS(open(bag, options), InputError, got);
    } else {
      const auto recording = open(bag, options);
      EXPECT_EQ(to_string(recording->size()) + ": " + std::to_string(all(*recording).size()), got);
    }
  }
}

TEST_F(Rosbag, IsReadOnceForAllThatComeAfter) {
  TestBag bag = three_chunks();
  bag.topics.push_back(kImages);
  bag.chunks[0].push_back({1, image(5, "mono8", 4, std::string(12, 'a'))});
  bag.chunks[2].push_back({1, image(6, "mono8", 4, std::string(12, 'b'))});
  bag.chunks.resize(20, {{1, image(7, "mono8", 4, std::string(100'000, 'x'))}});
  testing::write_file(path_, bag.bytes());
  for (const bool again : {false, true}) {
    const InputCounter counter;
    const EventIndexes indexes(folder_ / kEventIndexFile);
    const auto recording = open_recording(path_);
    EXPECT_EQ(counter.of(path_).bytes < 100'000, again);
    EXPECT_EQ(all(*recording), events_of({kFirst, kSecond, kThird}));
    EXPECT_EQ(recording->frame_time_s(1), seconds(6));
    EXPECT_EQ(recording->frame(1).pixels, std::vector<std::uint8_t>(12, 'b'));
    EXPECT_THAT(recording->notes(), texts_with({{"frames left out: 17"}}));
    indexes.save();
  }
}

TEST_F(Rosbag, RefusesOtherFiles) {
  const std::pair<std::string, std::string> cases[] = {
      {"#ROSBAG V1.2\n", "a ROS bag of another version than 2.0"},
      {"#ROSBAG V2.0\n", "expected a topic of events"},
      {"#ROSBAG V2.0\n\xff\xff\xff\xff", "expected a topic of events"},
      {"#ROSBAG V2.0\n" + std::string(200, '\0'), "expected a topic of events"}};
  for (const auto& [bytes, fault] : cases) EXPECT_THROWS(open(bytes), InputError, fault);
}

}  // namespace
}  // namespace eventgan::rosbag
