#include "stages/recordings/readers/detail/aedat4_file.h"

#include <aedat4_generated.h>
#include <fmt/core.h>

#include <algorithm>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <pugixml.hpp>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/detail/unpacking.h"

namespace eventgan {
namespace {

constexpr std::int64_t kPacketHeaderBytes = 8;
/// Of a packet, unpacked: sixteen million events, or a table of five million packets.
constexpr std::size_t kMostBytes = std::size_t{1} << 28;
/// Up to here, of the year 2112, whole microseconds stay distinct as seconds in a double.
constexpr std::int64_t kTimesEnd = std::int64_t{1} << 52;

static_assert(sizeof(aedat4::Event) == 16, "events are copied as they are stored");

// ---- Tables, times and sizes

template <class Number>
Number number_at(const std::string& bytes, std::size_t offset) {
  Number number;
  std::memcpy(&number, bytes.data() + offset, sizeof(number));
  return number;
}

/// As many tables as fit, since the default is less than a long recording has packets.
flatbuffers::Verifier verifier_of(const std::string& bytes) {
  const auto most_tables = static_cast<flatbuffers::uoffset_t>(bytes.size() / 4);
  return flatbuffers::Verifier(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                               64, most_tables);
}

/// The table of a whole FlatBuffer with its size in front, once every offset in it is known to be
/// sound. Numbers lie as their types want it counted from the size, or, of older writers, from
/// behind it: then the size is taken off `bytes`.
template <class Table>
const Table& table_of(std::string& bytes, const char* identifier) {
  constexpr std::size_t kSizeBytes = 4;
  // Verifiers of FlatBuffers 23 and later allow more bytes behind it.
  if (bytes.size() > kSizeBytes &&
      number_at<std::uint32_t>(bytes, 0) == bytes.size() - kSizeBytes) {
    flatbuffers::Verifier whole = verifier_of(bytes);
    if (whole.VerifySizePrefixedBuffer<Table>(identifier)) {
      return *flatbuffers::GetSizePrefixedRoot<Table>(bytes.data());
    }
    bytes.erase(0, kSizeBytes);
    flatbuffers::Verifier rest = verifier_of(bytes);
    if (rest.VerifyBuffer<Table>(identifier)) {
      return *flatbuffers::GetRoot<Table>(bytes.data());
    }
  }
  throw EventFault(fmt::format("expected a sound table {}, got another", identifier));
}

double seconds(std::int64_t time_us) { return static_cast<double>(time_us) / 1e6; }

void check_time(std::int64_t time_us) {
  if (time_us >= 0 && time_us < kTimesEnd) return;
  throw EventFault(fmt::format("expected a time of 0..{} µs, got {} µs", kTimesEnd - 1, time_us));
}

void check_size(std::int64_t size_bytes) {
  if (size_bytes <= static_cast<std::int64_t>(kMostBytes)) return;
  throw EventFault(fmt::format("expected at most {} bytes, got {}", kMostBytes, size_bytes));
}

std::string text_of(const PacketPlace& packet) {
  return fmt::format("stream {}, {} bytes at byte {}, {} elements, {} to {} µs", packet.stream,
                     packet.size_bytes, packet.byte, packet.count, packet.begin_us, packet.end_us);
}

/// The streams that the XML tells of: its node outInfo has a node for each, named by its number.
std::map<int, Aedat4File::Stream> streams_of(const std::string& xml) {
  pugi::xml_document document;
  if (const auto parsed = document.load_buffer(xml.data(), xml.size()); !parsed) {
    throw EventFault(
        fmt::format("expected XML of the streams, got none ({})", parsed.description()));
  }
  std::map<int, Aedat4File::Stream> streams;
  const auto attribute = [](const pugi::xml_node& node, const char* key) {
    return node.find_child_by_attribute("attr", "key", key).text();
  };
  for (const pugi::xml_node& node :
       document.child("dv").find_child_by_attribute("node", "name", "outInfo").children("node")) {
    const pugi::xml_node info = node.find_child_by_attribute("node", "name", "info");
    const int number = node.attribute("name").as_int(-1);
    const Aedat4File::Stream stream{
        attribute(node, "typeIdentifier").as_string(),
        {attribute(info, "sizeY").as_int(), attribute(info, "sizeX").as_int()}};
    if (number < 0 || !streams.emplace(number, stream).second) {
      throw EventFault(
          fmt::format("expected streams of different numbers, got another, {}", number));
    }
  }
  return streams;
}

}  // namespace

bool PacketPlace::may_have_events() const {
  constexpr auto kMostEvents = static_cast<std::int64_t>(kMostBytes / sizeof(aedat4::Event));
  return count > 0 && count <= kMostEvents && begin_us >= 0 && end_us >= begin_us &&
         end_us < kTimesEnd;
}

void check_packet(const PacketPlace& is, const PacketPlace& told) {
  const bool is_placed =
      told.byte == is.byte && told.stream == is.stream && told.size_bytes == is.size_bytes;
  const bool is_told = is.count >= 0 && told.count != 0;
  const bool is_counted = !is_told || told.count == is.count;
  const bool is_timed =
      !is_told || is.end_us == 0 || (told.begin_us == is.begin_us && told.end_us == is.end_us);
  if (is_placed && is_counted && is_timed) return;
  throw EventFault("expected the packet in the table as it is, " + text_of(is) + ", got " +
                   text_of(told));
}

Aedat4File::Aedat4File(const std::filesystem::path& path) : file_(path) {
  constexpr auto kLine = static_cast<std::int64_t>(kAedat4FirstLine.size());
  const std::string start = read(0, std::min(kLine + 4, file_.end_byte()));
  if (!start.starts_with(kAedat4FirstLine) || std::ssize(start) < kLine + 4) {
    refuse("expected \"#!AER-DAT4.0\" and a header, got another file", 0);
  }
  header_.end_byte = kLine + 4 + number_at<std::uint32_t>(start, kAedat4FirstLine.size());
  if (header_.end_byte > file_.end_byte()) {
    refuse(fmt::format("expected a header up to byte {}, got a file of {} bytes", header_.end_byte,
                       file_.end_byte()),
           kLine);
  }
  at(kLine, [&] {
    std::string bytes = read(kLine, header_.end_byte);
    const auto& table = table_of<aedat4::Header>(bytes, "IOHE");
    header_.compression = table.compression();
    header_.table_byte = table.table_byte();
    if (header_.compression < 0 || header_.compression > 4) {
      throw EventFault(fmt::format("expected a compression 0..4, got {}", header_.compression));
    }
    // After a crash it is where a table was to be.
    if (header_.table_byte < header_.end_byte || header_.table_byte > file_.end_byte()) {
      header_.table_byte = -1;
    }
    header_.streams = streams_of(table.info() ? table.info()->str() : std::string());
  });
}

void Aedat4File::refuse(const std::string& fault, std::int64_t byte) const {
  file_.refuse(fault, byte);
}

std::string Aedat4File::read(std::int64_t begin, std::int64_t end) const {
  check_size(end - begin);
  return file_.read_between(begin, end);
}

std::string Aedat4File::unpack(std::string bytes) const {
  if (header_.compression == 0) return bytes;
  return header_.compression <= 2 ? unpack_lz4(bytes, kMostBytes) : unpack_zstd(bytes, kMostBytes);
}

/// What is in a packet, whose stream and size must lie in front of it.
std::string Aedat4File::content(const PacketPlace& packet) const {
  check_size(packet.size_bytes);
  std::string bytes = file_.read_between(packet.byte - kPacketHeaderBytes, packet.end());
  PacketPlace is = packet;
  is.stream = number_at<std::int32_t>(bytes, 0);
  is.size_bytes = number_at<std::int32_t>(bytes, 4);
  check_packet(is, packet);
  bytes.erase(0, kPacketHeaderBytes);
  return unpack(std::move(bytes));
}

std::vector<PacketPlace> Aedat4File::read_table() const {
  std::vector<PacketPlace> told;
  if (header_.table_byte == -1) return told;
  at(header_.table_byte, [&] {
    std::string bytes = read(header_.table_byte, file_.end_byte());
    constexpr std::size_t kIdentifierAt = 8;  // as jAER writes it, whatever packets are
    const bool is_plain =
        bytes.size() > kIdentifierAt && bytes.compare(kIdentifierAt, 4, "FTAB") == 0;
    if (!is_plain) bytes = unpack(std::move(bytes));
    const auto* const entries = table_of<aedat4::PacketTable>(bytes, "FTAB").packets();
    for (flatbuffers::uoffset_t i = 0; entries && i < entries->size(); ++i) {
      const aedat4::PacketEntry& entry = *entries->Get(i);
      const aedat4::Packet* const packet = entry.packet();
      told.push_back({entry.byte(), packet ? packet->size_bytes() : -1,
                      packet ? packet->stream() : -1, entry.count(), entry.begin_us(),
                      entry.end_us()});
    }
  });
  std::ranges::stable_sort(told, {}, &PacketPlace::byte);
  // jAER counts from the packets' headers.
  if (!told.empty() && told[0].byte == header_.end_byte) {
    for (PacketPlace& packet : told) packet.byte += kPacketHeaderBytes;
  }
  return told;
}

std::vector<PacketPlace> Aedat4File::find_packets(const std::vector<PacketPlace>& table,
                                                  std::vector<std::string>& notes) const {
  const bool has_table = header_.table_byte != -1;
  const std::int64_t end = has_table ? header_.table_byte : file_.end_byte();
  std::vector<PacketPlace> packets;
  for (std::int64_t byte = header_.end_byte; byte < end;) {
    PacketPlace packet{byte + kPacketHeaderBytes};
    const std::size_t number = packets.size();
    if (number < table.size() && table[number].byte == packet.byte &&
        header_.streams.contains(table[number].stream) && table[number].size_bytes > 0) {
      packet.stream = table[number].stream;
      packet.size_bytes = table[number].size_bytes;
    } else if (packet.byte <= end) {
      const std::string bytes = read(byte, packet.byte);
      packet.stream = number_at<std::int32_t>(bytes, 0);
      packet.size_bytes = number_at<std::int32_t>(bytes, 4);
    }
    if (packet.byte <= end &&
        (!header_.streams.contains(packet.stream) || packet.size_bytes <= 0)) {
      refuse(fmt::format("expected a packet of a stream of the header, got {} "
                         "bytes of stream {}",
                         packet.size_bytes, packet.stream),
             byte);
    }
    if (packet.end() > end) {
      const std::string cut = fmt::format("expected a packet of {} bytes, got {}",
                                          kPacketHeaderBytes + packet.size_bytes, end - byte);
      if (has_table) refuse(cut, byte);
      notes.push_back(fmt::format("the last packet is cut off and left out: {}, in {} (byte {})",
                                  cut, name(), byte));
      break;
    }
    byte = packet.end();
    packets.push_back(packet);
  }
  return packets;
}

void Aedat4File::check_table(const std::vector<PacketPlace>& packets,
                             const std::vector<PacketPlace>& table, int event_stream) const {
  if (header_.table_byte == -1) return;
  if (table.size() != packets.size()) {
    refuse(fmt::format("expected a table of {} packets, as many as there are, got {}",
                       packets.size(), table.size()),
           header_.table_byte);
  }
  for (std::size_t i = 0; i < table.size(); ++i) {
    at(header_.table_byte, [&] { check_packet(packets[i], table[i]); });
  }
  const auto is_told = [&](const PacketPlace& packet) {
    return packet.stream == event_stream && packet.may_have_events();
  };
  const auto first = std::ranges::find_if(table, is_told);
  if (first == table.end()) return;
  PacketPlace is = packets[static_cast<std::size_t>(first - table.begin())];
  try {
    events(is);
  } catch (const InputError&) {
    return;  // damaged: the windows that need it are refused
  }
  at(header_.table_byte, [&] { check_packet(is, *first); });
}

CompactEvents Aedat4File::events(PacketPlace& packet) const {
  return at(packet.byte, [&] {
    std::string bytes = content(packet);
    const auto* const elements = table_of<aedat4::Events>(bytes, "EVTS").elements();
    PacketPlace is = packet;
    is.count = elements ? std::int64_t{elements->size()} : 0;
    CompactEvents events;
    events.reserve(static_cast<std::size_t>(is.count));
    for (std::int64_t i = 0; i < is.count; ++i) {
      aedat4::Event event;  // copied, since nothing says that it lies where 64-bit numbers should
      std::memcpy(&event, elements->Data() + static_cast<std::size_t>(i) * sizeof(event),
                  sizeof(event));
      check_time(event.t_us());
      const bool is_told = packet.count >= 0;
      if (is_told && (event.t_us() < packet.begin_us || event.t_us() > packet.end_us)) {
        throw EventFault(fmt::format("expected times of {} to {} µs, as the table says, got {} µs",
                                     packet.begin_us, packet.end_us, event.t_us()));
      }
      if (is_told && i > 0 && event.t_us() < is.end_us) {
        throw EventFault(fmt::format("expected times that never decrease, got {} µs after {} µs",
                                     event.t_us(), is.end_us));
      }
      if (i == 0) is.begin_us = event.t_us();
      is.end_us = event.t_us();
      events.push_back({static_cast<double>(event.x()), static_cast<double>(event.y()),
                        seconds(event.t_us()), static_cast<double>(event.on())});
    }
    if (packet.count >= 0) check_packet(is, packet);
    packet = is;
    return events;
  });
}

PlacedFrame Aedat4File::frame(const PacketPlace& packet, ImageSize size) const {
  return at(packet.byte, [&] {
    std::string bytes = content(packet);
    const aedat4::Frame& table = table_of<aedat4::Frame>(bytes, "FRME");
    const std::int64_t begin_us = table.exposure_begin_us();
    const std::int64_t end_us = table.exposure_end_us();
    PlacedFrame frame;
    std::int64_t time_us = table.t_us();
    if (begin_us != 0 || end_us != 0) {
      check_time(begin_us);
      check_time(end_us);
      if (end_us < begin_us) {
        throw EventFault(fmt::format("expected an exposure that ends at {} µs or later, got {}",
                                     begin_us, end_us));
      }
      time_us = begin_us + (end_us - begin_us) / 2;
    }
    check_time(time_us);
    frame.time_s = seconds(time_us);
    const ImageSize stored{table.height(), table.width()};
    if (stored != size || table.left() != 0 || table.top() != 0) {
      throw EventFault(fmt::format("expected a frame of {} at 0, 0, got {} at {}, {}",
                                   to_string(size), to_string(stored), table.left(), table.top()));
    }
    const int type = table.format();
    const int channels = CV_MAT_CN(type), bytes_per_value = CV_MAT_DEPTH(type) == CV_16U ? 2 : 1;
    if ((CV_MAT_DEPTH(type) != CV_8U && CV_MAT_DEPTH(type) != CV_16U) || type < 0 ||
        (channels != 1 && channels != 3 && channels != 4)) {
      throw EventFault(
          fmt::format("expected 1, 3 or 4 channels of 8 or 16 bits, got OpenCV's type {}", type));
    }
    const std::size_t values = size.pixel_count() * static_cast<std::size_t>(channels);
    const std::size_t count = table.pixels() ? table.pixels()->size() : 0;
    if (count != values * static_cast<std::size_t>(bytes_per_value)) {
      throw EventFault(fmt::format("expected {} bytes of pixels, got {}",
                                   values * static_cast<std::size_t>(bytes_per_value), count));
    }
    frame.is_colour = channels > 1;
    frame.is_deep = bytes_per_value > 1;
    std::vector<std::uint8_t> pixels(values);  // of 16 bits, little-endian, the upper byte
    for (std::size_t i = 0; i < values; ++i) {
      const std::size_t at_byte = frame.is_deep ? 2 * i + 1 : i;
      pixels[i] = table.pixels()->Get(static_cast<flatbuffers::uoffset_t>(at_byte));
    }
    frame.image = {size, std::vector<std::uint8_t>(size.pixel_count())};
    if (!frame.is_colour) {
      frame.image.pixels = std::move(pixels);
    } else {
      const cv::Mat colour(size.height, size.width, CV_8UC(channels), pixels.data());
      cv::Mat grey(size.height, size.width, CV_8UC1, frame.image.pixels.data());
      cv::cvtColor(colour, grey, channels == 3 ? cv::COLOR_BGR2GRAY : cv::COLOR_BGRA2GRAY);
    }
    return frame;
  });
}

}  // namespace eventgan
