#include "stages/recordings/readers/detail/aedat4_recording.h"

#include <aedat4_generated.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <functional>
#include <string>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Throws;

constexpr int kEventStream = 0;
constexpr int kFrameStream = 1;
constexpr int kImuStream = 7;
constexpr const char* kInfo = R"(<dv version="2.0"><node name="outInfo">
  <node name="0"><attr key="typeIdentifier" type="string">EVTS</attr>
    <node name="info"><attr key="sizeX" type="int">4</attr><attr key="sizeY" type="int">3</attr></node></node>
  <node name="1"><attr key="typeIdentifier" type="string">FRME</attr></node>
  <node name="7"><attr key="typeIdentifier" type="string">IMUS</attr></node></node></dv>)";

std::string text_of(const flatbuffers::FlatBufferBuilder& builder) {
  return {reinterpret_cast<const char*>(builder.GetBufferPointer()), builder.GetSize()};
}

std::string number_bytes(std::int32_t number) {
  return {reinterpret_cast<const char*>(&number), sizeof(number)};
}

std::string events_table(const std::vector<aedat4::Event>& events) {
  flatbuffers::FlatBufferBuilder builder;
  const auto elements = builder.CreateVectorOfStructs(events);
  builder.FinishSizePrefixed(aedat4::CreateEvents(builder, elements), "EVTS");
  return text_of(builder);
}

struct TestFrame {
  std::int64_t t_us = 0;
  std::int64_t begin_us = 0;
  std::int64_t end_us = 0;
  int format = 0;
  int width = 4;
  int height = 3;
  int left = 0;
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(12, 5);
};

std::string frame_table(const TestFrame& frame) {
  flatbuffers::FlatBufferBuilder builder;
  const auto pixels = builder.CreateVector(frame.pixels);
  builder.FinishSizePrefixed(
      aedat4::CreateFrame(builder, frame.t_us, 0, 0, frame.begin_us, frame.end_us,
                          static_cast<std::int8_t>(frame.format),
                          static_cast<std::int16_t>(frame.width),
                          static_cast<std::int16_t>(frame.height),
                          static_cast<std::int16_t>(frame.left), 0, pixels),
      "FRME");
  return text_of(builder);
}

std::string packed(const std::string& text, int compression) {
  if (compression == 0) return text;
  std::string result(compression <= 2 ? LZ4F_compressFrameBound(text.size(), nullptr)
                                      : ZSTD_compressBound(text.size()),
                     '\0');
  result.resize(
      compression <= 2
          ? LZ4F_compressFrame(result.data(), result.size(), text.data(), text.size(), nullptr)
          : ZSTD_compress(result.data(), result.size(), text.data(), text.size(), 1));
  return result;
}

struct TestPacket {
  int stream = kEventStream;
  std::string table;
  std::int64_t count = 0;  ///< as the table of packets says
  std::int64_t begin_us = 0;
  std::int64_t end_us = 0;
};

TestPacket events_packet(const std::vector<aedat4::Event>& events) {
  TestPacket packet{kEventStream, events_table(events), std::ssize(events)};
  if (!events.empty()) {
    packet.begin_us = events.front().t_us();
    packet.end_us = events.back().t_us();
  }
  return packet;
}

/// Writes the packets with what belongs around them.
struct TestFile {
  std::string info = kInfo;
  int compression = 0;
  bool has_table = true;
  std::vector<TestPacket> packets;

  std::string header(std::int64_t table_byte) const {
    flatbuffers::FlatBufferBuilder builder;
    builder.ForceDefaults(true);  // so that it is as long with a table as without
    const auto text = builder.CreateString(info);
    builder.FinishSizePrefixed(aedat4::CreateHeader(builder, compression, table_byte, text),
                               "IOHE");
    return "#!AER-DAT4.0\r\n" + text_of(builder);
  }

  std::string bytes() const {
    std::string result = header(-1);
    flatbuffers::FlatBufferBuilder builder;
    std::vector<flatbuffers::Offset<aedat4::PacketEntry>> entries;
    for (const TestPacket& packet : packets) {
      const std::string content = packed(packet.table, compression);
      const aedat4::Packet place(packet.stream, static_cast<std::int32_t>(content.size()));
      result += number_bytes(packet.stream) + number_bytes(place.size_bytes());
      entries.push_back(aedat4::CreatePacketEntry(builder, std::ssize(result), &place, packet.count,
                                                  packet.begin_us, packet.end_us));
      result += content;
    }
    if (!has_table) return result;
    const std::string start = header(std::ssize(result));
    result.replace(0, start.size(), start);
    builder.FinishSizePrefixed(aedat4::CreatePacketTable(builder, builder.CreateVector(entries)),
                               "FTAB");
    return result + packed(text_of(builder), compression);
  }
};

class Aedat4Test : public ::testing::Test {
 protected:
  std::unique_ptr<Recording> open(const std::string& bytes) {
    testing::write_file(path_, bytes);
    return open_recording(path_, RecordingFormat::kAedat4);
  }
  std::unique_ptr<Recording> open(const TestFile& file) { return open(file.bytes()); }

  void expect_refused(const std::string& bytes, const std::string& reason) {
    EXPECT_THROWS(open(bytes), InputError, reason, path_.string());
  }

  /// A packet that the table tells of is read when its events are asked for.
  void expect_refused_when_read(const std::string& bytes, const std::string& reason) {
    const auto recording = open(bytes);
    EXPECT_THROWS(recording->events_in(0, 2), InputError, reason, path_.string());
  }

  /// Three packets of events, the second empty, two frames, and one of a stream that is not read.
  static TestFile small() {
    TestFile file;
    file.packets = {
        events_packet({{1'000'000, 0, 0, 1}, {1'000'001, 3, 2, 0}}),
        {kFrameStream, frame_table({.t_us = 1'000'001}), 1},
        {kImuStream, "anything", 1},
        events_packet({}),
        {kFrameStream, frame_table({.t_us = 7, .begin_us = 1'000'003, .end_us = 1'000'006}), 1},
        events_packet({{1'000'001, 1, 1, 1}, {1'000'004, 2, 1, 0}, {1'000'009, 2, 2, 1}})};
    return file;
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "recording.aedat4";
};

TEST_F(Aedat4Test, ReadsWhatEachCompressionHolds) {
  for (const int compression : {0, 1, 2, 3, 4}) {
    TestFile file = small();
    file.compression = compression;
    const auto recording = open(file);
    EXPECT_EQ(recording->size(), (ImageSize{3, 4}));
    ASSERT_EQ(recording->frame_count(), 2);
    EXPECT_EQ(recording->frame_time_s(0), 1.000001);
    EXPECT_EQ(recording->frame_time_s(1), 1.000004);  // of 1.000003 to 1.000006: rounded down
    EXPECT_EQ(recording->frame(1), (GreyImage{{3, 4}, std::vector<std::uint8_t>(12, 5)}));
    EXPECT_THAT(recording->events_in(0, 2),
                ElementsAre(Event{0, 0, 1.0, true}, Event{3, 2, 1.000001, false},
                            Event{1, 1, 1.000001, true}, Event{2, 1, 1.000004, false},
                            Event{2, 2, 1.000009, true}));
    EXPECT_THAT(recording->events_between(0, 1), ElementsAre(Event{2, 1, 1.000004, false}));
    EXPECT_THAT(recording->events_around(1.000001, 1, 1),
                ElementsAre(Event{1, 1, 1.000001, true}, Event{2, 1, 1.000004, false}));
    EXPECT_THAT(recording->notes(), IsEmpty());
    EXPECT_EQ(find_recording_format(path_), RecordingFormat::kAedat4);
  }
}

TEST_F(Aedat4Test, ReadsAFileWithoutFrames) {
  TestFile file = small();
  std::erase_if(file.packets,
                [](const TestPacket& packet) { return packet.stream != kEventStream; });
  EXPECT_EQ(open(file)->frame_count(), 0);
  file.packets.clear();
  EXPECT_EQ(open(file)->event_span(), std::nullopt);
}

/// Of `packets` packets of a thousand events, one each microsecond.
TestFile long_file(int packets) {
  constexpr std::int64_t kInPacket = 1000;
  TestFile file;
  for (int i = 0; i < packets; ++i) {
    std::vector<aedat4::Event> events;
    for (std::int64_t k = 0; k < kInPacket; ++k) events.emplace_back(i * kInPacket + k, 1, 2, 1);
    file.packets.push_back(events_packet(events));
  }
  return file;
}

TEST_F(Aedat4Test, IsReadOnceForAllWindows) {
  TestFile file = long_file(40);
  file.packets.push_back({kFrameStream, frame_table({.t_us = 39'999}), 1});
  for (const bool has_table : {true, false}) {
    file.has_table = has_table;
    testing::write_file(path_, file.bytes());
    const InputCounter counter;
    const auto recording = open_recording(path_, find_recording_format(path_));
    EXPECT_EQ(recording->event_span(), (std::array{0.0, 0.039999}));
    std::size_t events = 0;
    for (int i = 0; i < 80; ++i) {  // each of half a packet
      events += recording->events_in(i * 500e-6 - 0.1e-6, (i + 1) * 500e-6 - 0.1e-6).size();
    }
    EXPECT_EQ(events, 40'000u);
    EXPECT_EQ(counter.of(path_).opens, 2u);  // to recognise it, and to read it
    EXPECT_LE(static_cast<double>(counter.of(path_).bytes),
              1.2 * static_cast<double>(std::filesystem::file_size(path_)));
  }
}

TEST_F(Aedat4Test, OfItsPacketsOnlyThoseOfTheWindowAreRead) {
  testing::write_file(path_, long_file(40).bytes());
  constexpr std::uint64_t kPacket = 16'000;
  const InputCounter counter;
  const auto recording = open_recording(path_, RecordingFormat::kAedat4);
  EXPECT_EQ(recording->frame_count(), 0);
  EXPECT_LT(counter.of(path_).bytes, 3 * kPacket / 2);  // header, table and the first packet
  // Of packets 20 and 21; their times are looked for up to 512 events around.
  EXPECT_EQ(recording->events_in(0.0206, 0.0214).size(), 800u);
  EXPECT_LT(counter.of(path_).bytes, 4 * kPacket);
}

// Grey as ITU-R BT.601 weighs: 0.114 * 10 + 0.587 * 100 + 0.299 * 200 = 119.64.
TEST_F(Aedat4Test, MakesColourGrey) {
  for (const int channels : {3, 4}) {
    TestFrame frame{.t_us = 5, .format = channels == 3 ? 16 : 24, .pixels = {}};
    for (int i = 0; i < 12; ++i) {
      frame.pixels.insert(frame.pixels.end(), {10, 100, 200});
      if (channels == 4) frame.pixels.push_back(77);
    }
    TestFile file;
    file.packets = {{kFrameStream, frame_table(frame), 1}};
    const auto recording = open(file);
    EXPECT_EQ(recording->frame(0).pixels, std::vector<std::uint8_t>(12, 120));
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("frames in colour are made grey")));
  }
}

TEST_F(Aedat4Test, ReadsWhatAnUnpluggedCameraLeft) {
  TestFile file = small();
  file.has_table = false;
  const std::string whole = file.bytes();
  EXPECT_THAT(open(whole)->notes(), ElementsAre(HasSubstr("no table of packets")));
  EXPECT_EQ(open(whole)->events_in(0, 2).size(), 5u);
  // The last packet takes 8 bytes and 104 of its table: cut off in the one, in the other.
  const std::size_t last = 8 + file.packets.back().table.size();
  for (const std::size_t missing : {std::size_t{1}, last - 8, last - 1}) {
    const auto recording = open(whole.substr(0, whole.size() - missing));
    EXPECT_EQ(recording->events_in(0, 2).size(), 2u);
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("no table"),
                                                HasSubstr("got " + std::to_string(last - missing) +
                                                          ", in " + path_.string())));
  }
  EXPECT_THAT(open(whole.substr(0, whole.size() - last))->notes(),
              ElementsAre(HasSubstr("no table")));
}

TEST_F(Aedat4Test, TakesATableOfOlderWriters) {
  TestFile file = small();
  for (TestPacket& packet : file.packets) packet.count = packet.begin_us = packet.end_us = 0;
  EXPECT_EQ(open(file)->events_in(0, 2).size(), 5u);
}

// Older writers align numbers counted from behind the length in front.
TEST_F(Aedat4Test, ReadsTablesOfBothAlignments) {
  TestFile file = small();
  file.has_table = false;
  const std::string packets = file.bytes().substr(file.header(-1).size());
  flatbuffers::FlatBufferBuilder builder;
  builder.ForceDefaults(true);
  const auto text = builder.CreateString(file.info);
  builder.Finish(aedat4::CreateHeader(builder, 0, -1, text), "IOHE");
  const std::string table =
      number_bytes(static_cast<std::int32_t>(builder.GetSize())) + text_of(builder);
  flatbuffers::Verifier in_front(reinterpret_cast<const std::uint8_t*>(table.data()), table.size());
  EXPECT_FALSE(in_front.VerifySizePrefixedBuffer<aedat4::Header>("IOHE"));
  EXPECT_EQ(open("#!AER-DAT4.0\r\n" + table + packets)->events_in(0, 2).size(), 5u);
}

TEST_F(Aedat4Test, DoesWithoutATableThatSaysOtherwise) {
  using Change = std::function<void(TestFile&)>;
  const auto changed = [](const Change& change) {
    TestFile file = small();
    change(file);
    return file.bytes();
  };
  const auto expect_read = [&](const std::string& bytes) {
    const auto recording = open(bytes);
    EXPECT_EQ(recording->events_in(0, 2).size(), 5u);
    EXPECT_EQ(recording->frame_count(), 2);
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("the table of packets is not used")));
  };
  expect_read(changed([](TestFile& file) { file.packets[0].count = 3; }));
  expect_read(changed([](TestFile& file) { file.packets[0].begin_us -= 1; }));
  const std::string whole = small().bytes();
  expect_read(whole.substr(0, whole.size() - 20));
  expect_read(whole + "rest");
  TestFile without = small();
  without.has_table = false;
  for (std::size_t left = 0; left < 12; ++left) {
    SCOPED_TRACE(left);
    expect_read(whole.substr(0, without.bytes().size() + left));
  }
  // Seen when a later packet is read: its windows are refused.
  const std::pair<Change, const char*> seen_when_read[] = {
      {[](TestFile& file) { file.packets[5].begin_us += 1; },
       "expected times of 1000002 to 1000009 µs, as the table says, got 1000001 µs"},
      {[](TestFile& file) { file.packets[5].end_us += 1; },
       "expected the packet in the table as it is"}};
  for (const auto& [change, why] : seen_when_read) {
    EXPECT_THROWS(open(changed(change))->events_in(0, 2), InputError, why, path_.string());
  }
  // After a crash: a place where no table came to be.
  TestFile file = small();
  file.has_table = false;
  std::string crashed = file.bytes();
  crashed.replace(0, file.header(-1).size(), file.header(-2));
  EXPECT_EQ(open(crashed)->events_in(0, 2).size(), 5u);
  EXPECT_THAT(open(crashed)->notes(), ElementsAre(HasSubstr("no table of packets")));
}

// jAER's has the places of the packets' headers, and is not packed where they are.
TEST_F(Aedat4Test, ReadsATableOfJaer) {
  for (const int compression : {0, 1}) {
    TestFile file = small();
    file.compression = compression;
    const std::string whole = file.bytes();
    flatbuffers::FlatBufferBuilder builder;
    std::vector<flatbuffers::Offset<aedat4::PacketEntry>> entries;
    std::int64_t byte = std::ssize(file.header(-1));
    for (const TestPacket& packet : file.packets) {
      const std::string content = packed(packet.table, compression);
      const aedat4::Packet place(packet.stream, static_cast<std::int32_t>(content.size()));
      entries.push_back(aedat4::CreatePacketEntry(builder, byte, &place, packet.count,
                                                  packet.begin_us, packet.end_us));
      byte += 8 + std::ssize(content);
    }
    builder.FinishSizePrefixed(aedat4::CreatePacketTable(builder, builder.CreateVector(entries)),
                               "FTAB");
    const auto recording = open(whole.substr(0, static_cast<std::size_t>(byte)) + text_of(builder));
    EXPECT_EQ(recording->events_in(0, 2).size(), 5u);
    EXPECT_THAT(recording->notes(), IsEmpty());
  }
}

TEST_F(Aedat4Test, RefusesWindowsWhoseTimesFallAndTimesThatCannotBe) {
  for (const bool has_table : {true, false}) {
    TestFile file = long_file(4);
    file.has_table = has_table;
    std::swap(file.packets[1], file.packets[2]);
    const auto swapped = open(file);
    EXPECT_EQ(swapped->event_span(), (std::array{0.0, 0.003999}));
    EXPECT_EQ(swapped->events_in(-1, 0.0009).size(), 901u);
    EXPECT_EQ(swapped->events_in(0.0031, 1).size(), 899u);
    for (const double after_s : {0.0005, 0.0012, 0.0022}) {
      EXPECT_THROWS(swapped->events_in(after_s, after_s + 0.0005), InputError,
                    "expected times that never decrease", path_.string() + " (event ");
    }
  }
  TestFile file = small();
  file.packets[0] = events_packet({{1'000'000, 0, 0, 1}, {999'999, 0, 0, 1}});
  const auto fallen = open(file);
  EXPECT_EQ(fallen->events_in(1.000001, 2).size(), 2u);
  EXPECT_THROWS(fallen->events_in(0, 1), InputError, "expected times that never decrease");
  // Between the times that the table tells: no window loses an event in silence.
  file.packets[0] = events_packet({{10, 0, 0, 1}, {15, 1, 0, 1}, {12, 2, 0, 1}, {20, 3, 0, 1}});
  const auto within = open(file);
  for (const auto& [after_s, until_s] : {std::pair(9e-6, 13e-6), {13e-6, 20e-6}, {0.0, 1.0}}) {
    EXPECT_THROWS(within->events_in(after_s, until_s), InputError, "got 12 µs after 15 µs",
                  path_.string());
  }
  EXPECT_EQ(within->events_in(20e-6, 2).size(), 3u);
  file.has_table = false;
  for (const std::int64_t time_us :
       {std::int64_t{-1}, std::int64_t{1} << 52, std::numeric_limits<std::int64_t>::max()}) {
    file.packets[0] = events_packet({{time_us, 0, 0, 1}});
    expect_refused(file.bytes(), "expected a time of 0..4503599627370495 µs, got");
  }
}

TEST_F(Aedat4Test, RefusesEventsBesideTheSensorAndOddPolarities) {
  TestFile file;
  file.packets = {events_packet({{5, 4, 0, 1}})};
  const auto beside = open(file);
  EXPECT_THROWS(beside->events_in(0, 1), InputError, "an image of 4x3, got x = 4, y = 0");
  file.packets = {events_packet({{5, 0, -1, 1}})};
  const auto above = open(file);
  EXPECT_THROWS(above->events_in(0, 1), InputError, "y = -1");
  file.packets = {events_packet({{5, 0, 0, 2}})};
  const auto odd = open(file);
  EXPECT_THROWS(odd->events_in(0, 1), InputError, "got 2, in " + path_.string() + " (event 0)");
}

TEST_F(Aedat4Test, LeavesOutFramesThatDoNotFit) {
  const std::pair<TestFrame, const char*> frames[] = {
      {{.t_us = 9, .width = 3}, "expected a frame of 4x3 at 0, 0, got 3x3 at 0, 0"},
      {{.t_us = 9, .left = 1}, "got 4x3 at 1, 0"},
      {{.t_us = 9, .height = -3}, "got 4x-3"},
      {{.t_us = 9, .format = 16}, "expected 36 bytes of pixels, got 12"},
      {{.t_us = 9, .format = 5},
       "expected 1, 3 or 4 channels of 8 or 16 bits, got OpenCV's type 5"},
      {{.t_us = 9, .pixels = {}}, "expected 12 bytes of pixels, got 0"},
      {{.begin_us = 9, .end_us = 8}, "expected an exposure that ends at 9 µs or later, got 8"},
      {{.t_us = 1}, "expected a frame after 0.000001 s, got one at 0.000001 s"},
      {{.t_us = 0}, "got one at 0.000000 s"}};
  for (const auto& [frame, reason] : frames) {
    TestFile file;
    file.packets = {{kFrameStream, frame_table({.t_us = 1}), 1},
                    {kFrameStream, frame_table(frame), 1},
                    {kFrameStream, frame_table({.t_us = 10}), 1},
                    events_packet({{5, 0, 0, 1}})};
    const auto recording = open(file);
    ASSERT_EQ(recording->frame_count(), 2) << reason;
    EXPECT_EQ(recording->frame_time_s(1), 10e-6);
    EXPECT_EQ(recording->events_between(0, 1).size(), 1u);
    EXPECT_THAT(recording->notes(),
                ElementsAre(AllOf(HasSubstr("frames left out: 1"), HasSubstr(reason))));
    file.packets.erase(file.packets.begin() + 2);
    file.packets.erase(file.packets.begin());
    if (frame.t_us == 9 || frame.end_us > 0) {
      EXPECT_EQ(open(file)->frame_count(), 0);
      EXPECT_THAT(open(file)->notes(), ElementsAre(HasSubstr(reason)));
    }
  }
}

// As jAER writes them: the upper of two bytes, little-endian.
TEST_F(Aedat4Test, TakesTheUpperBitsOfFramesOf16) {
  TestFrame frame{.t_us = 5, .format = 2, .pixels = {}};
  for (int i = 0; i < 12; ++i) {
    frame.pixels.insert(frame.pixels.end(), {0xff, static_cast<std::uint8_t>(20 * i)});
  }
  TestFile file;
  file.packets = {{kFrameStream, frame_table(frame), 1}};
  const auto recording = open(file);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(recording->frame(0).pixels[i], 20 * i);
  EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("of 16 bits the upper 8 are taken")));
}

constexpr const char* kTwoCameras = R"(<dv version="2.0"><node name="outInfo">
  <node name="0"><attr key="typeIdentifier">EVTS</attr>
    <node name="info"><attr key="sizeX">4</attr><attr key="sizeY">3</attr></node></node>
  <node name="1"><attr key="typeIdentifier">FRME</attr></node>
  <node name="4"><attr key="typeIdentifier">EVTS</attr></node>
  <node name="5"><attr key="typeIdentifier">FRME</attr></node></node></dv>)";

TEST_F(Aedat4Test, TakesTheFirstCameraOrTheOneThatIsNamed) {
  TestFile file;
  file.info = kTwoCameras;
  file.packets = {events_packet({{5, 1, 1, 1}}),
                  {1, frame_table({.t_us = 1}), 1},
                  events_packet({{6, 2, 1, 1}, {7, 3, 1, 1}}),
                  {5, frame_table({.t_us = 2}), 1}};
  file.packets[2].stream = 4;
  const auto first = open(file);
  EXPECT_THAT(first->events_in(0, 1), ElementsAre(Event{1, 1, 5e-6, true}));
  EXPECT_EQ(first->frame_time_s(0), 1e-6);
  EXPECT_THAT(first->notes(),
              ElementsAre(HasSubstr("of several streams of events (0, 4) the first is taken"),
                          HasSubstr("of several streams of frames (1, 5) 1 is taken")));
  RecordingOptions options{.stream = 4};
  const auto named = [&] { return open_recording(path_, RecordingFormat::kAedat4, options); };
  // Nothing tells this camera's size.
  EXPECT_THROWS(named(), InputError, "\"sensor\": {\"width\"");
  options.sensor = ImageSize{3, 4};
  EXPECT_EQ(named()->events_in(0, 1).size(), 2u);
  EXPECT_EQ(named()->frame_time_s(0), 2e-6);
  options.stream = 1;
  EXPECT_THROWS(named(), InputError, "to be one of events, 0, 4, got 1");
}

TEST_F(Aedat4Test, RefusesOtherHeaders) {
  expect_refused("", "expected \"#!AER-DAT4.0\"");
  expect_refused("#!AER-DAT4.0\r\n\1", "expected \"#!AER-DAT4.0\"");
  expect_refused("#!AER-DAT3.1\r\n      ", "expected \"#!AER-DAT4.0\"");
  expect_refused("#!AER-DAT4.0\r\n\xff\xff\xff\xff", "got a file of 18 bytes");
  expect_refused(std::string("#!AER-DAT4.0\r\n\4\0\0\0text", 22), "expected a sound table IOHE");
  TestFile file = small();
  file.compression = 5;
  expect_refused(file.header(-1), "expected a compression 0..4, got 5");
  file.compression = 0;
  const std::pair<const char*, const char*> infos[] = {
      {"<dv", "expected XML of the streams"},
      {"<dv/>", "expected a stream of events (EVTS), got none"},
      {R"(<dv><node name="outInfo"><node name="0"><attr key="typeIdentifier">EVTS</attr></node></node></dv>)",
       "expected the sensor's size in the file, or "},
      {R"(<dv><node name="outInfo"><node name="0"/><node name="0"/></node></dv>)",
       "expected streams of different numbers"}};
  for (const auto& [info, reason] : infos) {
    file.info = info;
    expect_refused(file.header(-1), reason);
  }
}

TEST_F(Aedat4Test, RefusesBrokenPackets) {
  TestFile file;
  file.packets = {events_packet({{1, 0, 0, 1}})};
  file.packets[0].stream = 3;
  expect_refused(file.bytes(), "of stream 3");
  file = small();
  const std::string whole = file.bytes();
  // With a table it is no matter of an unplugged camera.
  std::string longer = whole;
  const std::size_t size_at = file.header(-1).size() + 4;
  for (const std::int32_t size_bytes : {1 << 28, -1, 0}) {
    longer.replace(size_at, 4, number_bytes(size_bytes));
    expect_refused_when_read(longer, "in the table as it is, stream 0, " +
                                         std::to_string(size_bytes) + " bytes at byte");
    // Without a table nothing else tells.
    std::string unplugged = longer;
    unplugged.replace(0, file.header(-1).size(), file.header(-1));
    if (size_bytes > 0) continue;
    expect_refused(unplugged, "got " + std::to_string(size_bytes) + " bytes of stream 0");
  }
  for (const int compression : {1, 3}) {
    file.compression = compression;
    std::string damaged = file.bytes();
    damaged[file.header(-1).size() + 8] ^= 1;
    const std::string reason = compression == 1 ? "expected an LZ4 frame" : "expected a Zstandard";
    expect_refused_when_read(damaged, reason);
    TestFile unplugged = file;
    unplugged.has_table = false;
    damaged = unplugged.bytes();
    damaged[file.header(-1).size() + 8] ^= 1;
    expect_refused(damaged, reason);
  }
  // A frame that ends before it is whole, as the packet says its size.
  file.compression = 0;
  const std::string content = packed(file.packets[0].table, 1);
  file.packets = {{kEventStream, content.substr(0, content.size() - 5)}};
  file.has_table = false;
  std::string cut = file.bytes();
  file.compression = 1;
  cut.replace(0, file.header(-1).size(), file.header(-1));
  expect_refused(cut, "expected a whole packed frame, got one that is cut off");
}

// 257 MiB of zeros in some kilobytes: what comes out is bounded, whatever the packet claims.
TEST_F(Aedat4Test, RefusesABomb) {
  TestFile file;
  file.compression = 3;
  file.packets = {{kEventStream, std::string(std::size_t{257} << 20, '\0')}};
  file.has_table = false;
  EXPECT_THROWS(open(file), InputError, "at most 268435456 bytes unpacked, got more");
}

// Files with holes: nothing is read of what is larger than any table.
TEST_F(Aedat4Test, RefusesTablesTooLarge) {
  testing::write_file(path_, "#!AER-DAT4.0\r\n" + number_bytes(1 << 29));
  std::filesystem::resize_file(path_, std::uintmax_t{1} << 30);
  EXPECT_THROWS(open_aedat4(path_), InputError, "at most 268435456 bytes, got 536870916");
  TestFile file;
  file.has_table = false;
  const std::string start = file.bytes() + number_bytes(kEventStream) + number_bytes(1 << 29);
  testing::write_file(path_, start);
  std::filesystem::resize_file(path_, start.size() + (1 << 29));
  EXPECT_THROWS(open_aedat4(path_), InputError, "at most 268435456 bytes, got 536870912");
}

// The converted file was made of it by another program.
TEST_F(Aedat4Test, ReadsADavis346AsItsConversionIs) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto recording = open_recording(data / "davis/davis346.aedat4", RecordingFormat::kAedat4);
  const auto converted =
      open_recording(data / "davis/davis346_eventgan_layout.hdf5", RecordingFormat::kEventgan);
  EXPECT_EQ(recording->size(), (ImageSize{260, 346}));
  ASSERT_EQ(recording->frame_count(), 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(recording->frame_time_s(i), converted->frame_time_s(i));
    EXPECT_EQ(recording->frame(i), converted->frame(i));
  }
  const std::vector<Event> events = recording->events_in(0, 2e9);
  EXPECT_EQ(events.size(), 117'667u);
  EXPECT_EQ(events, converted->events_in(0, 2e9));
  EXPECT_EQ(recording->events_between(0, 2), converted->events_between(0, 2));
  EXPECT_THAT(recording->notes(), IsEmpty());
}

TEST_F(Aedat4Test, ReadsFilesOfTwoCameras) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto fixtures = data / "real_labels/fixtures";
  const auto davis = open_recording(fixtures / "davis346.aedat4", RecordingFormat::kAedat4);
  EXPECT_EQ(davis->frame_count(), 4);
  EXPECT_EQ(davis->events_in(0, 2e9).size(), 6676u);
  const auto explorer = open_recording(fixtures / "dvxplorer.aedat4", RecordingFormat::kAedat4);
  EXPECT_EQ(explorer->size(), (ImageSize{240, 320}));
  EXPECT_EQ(explorer->frame_count(), 0);
  EXPECT_EQ(explorer->events_in(0, 2e9).size(), 111'954u);
  EXPECT_EQ(find_recording_format(fixtures / "dvxplorer.aedat4"), RecordingFormat::kAedat4);
}

}  // namespace
}  // namespace eventgan
