#include "stages/recordings/detail/aedat4_recording.h"

#include <aedat4_generated.h>
#include <fmt/core.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <opencv2/imgproc.hpp>
#include <pugixml.hpp>
#include <string_view>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"
#include "stages/recordings/detail/event_parts.h"
#include "stages/recordings/detail/frame_intervals.h"
#include "stages/recordings/detail/recording_reader.h"

namespace eventgan {
namespace {

constexpr std::string_view kFirstLine = "#!AER-DAT4.0\r\n";
constexpr std::int64_t kPacketHeaderBytes = 8;
/// Of a packet, unpacked: sixteen million events, or a table of five million packets.
constexpr std::size_t kMostBytes = std::size_t{1} << 28;
/// Up to here, of the year 2112, whole microseconds stay distinct as seconds in a double.
constexpr std::int64_t kTimesEnd = std::int64_t{1} << 52;

static_assert(sizeof(aedat4::Event) == 16, "events are copied as they are stored");

// ---- Unpacking

template <class Context, auto release>
struct Released {
  void operator()(Context* context) const { release(context); }
};
using Lz4Context = std::unique_ptr<LZ4F_dctx, Released<LZ4F_dctx, LZ4F_freeDecompressionContext>>;
using ZstdContext = std::unique_ptr<ZSTD_DStream, Released<ZSTD_DStream, ZSTD_freeDStream>>;

/// What one step of unpacking took and gave.
struct UnpackStep {
  std::size_t taken = 0;
  std::size_t given = 0;
  bool is_end = false;
};

/// Memory grows with what comes out, not with what the frame claims. `step` gets the target and the
/// packed bytes left.
template <class Step>
std::string unpack_by(std::string_view packed, Step step) {
  std::string unpacked;
  std::size_t used = 0;
  for (;;) {
    if (used == unpacked.size()) {
      if (used == kMostBytes) {
        throw EventFault(fmt::format("expected at most {} bytes unpacked, got more", kMostBytes));
      }
      unpacked.resize(std::min(std::max(2 * used, 4 * packed.size() + 64), kMostBytes));
    }
    const UnpackStep made = step(unpacked.data() + used, unpacked.size() - used, packed);
    used += made.given;
    packed.remove_prefix(made.taken);
    if (made.is_end) break;
    if (made.taken == 0 && made.given == 0) {
      throw EventFault("expected a whole packed frame, got one that is cut off");
    }
  }
  if (!packed.empty()) {
    throw EventFault(
        fmt::format("expected one packed frame, got {} bytes behind its end", packed.size()));
  }
  unpacked.resize(used);
  return unpacked;
}

std::string unpack_lz4(std::string_view packed) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) throw std::bad_alloc();
  const Lz4Context context(made);
  return unpack_by(packed, [&](char* target, std::size_t room, std::string_view rest) {
    UnpackStep step{rest.size(), room};
    const std::size_t hint =
        LZ4F_decompress(context.get(), target, &step.given, rest.data(), &step.taken, nullptr);
    if (LZ4F_isError(hint)) {
      throw EventFault(
          fmt::format("expected an LZ4 frame, got damage ({})", LZ4F_getErrorName(hint)));
    }
    step.is_end = hint == 0;
    return step;
  });
}

std::string unpack_zstd(std::string_view packed) {
  const ZstdContext context(ZSTD_createDStream());
  if (!context) throw std::bad_alloc();
  return unpack_by(packed, [&](char* target, std::size_t room, std::string_view rest) {
    ZSTD_outBuffer output{target, room, 0};
    ZSTD_inBuffer input{rest.data(), rest.size(), 0};
    const std::size_t hint = ZSTD_decompressStream(context.get(), &output, &input);
    if (ZSTD_isError(hint)) {
      throw EventFault(
          fmt::format("expected a Zstandard frame, got damage ({})", ZSTD_getErrorName(hint)));
    }
    return UnpackStep{input.pos, output.pos, hint == 0};
  });
}

// ---- The file

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
  flatbuffers::Verifier whole = verifier_of(bytes);
  if (whole.VerifySizePrefixedBuffer<Table>(identifier)) {
    return *flatbuffers::GetSizePrefixedRoot<Table>(bytes.data());
  }
  constexpr std::size_t kSizeBytes = 4;
  if (bytes.size() > kSizeBytes &&
      number_at<std::uint32_t>(bytes, 0) == bytes.size() - kSizeBytes) {
    bytes.erase(0, kSizeBytes);
    flatbuffers::Verifier rest = verifier_of(bytes);
    if (rest.VerifyBuffer<Table>(identifier)) {
      return *flatbuffers::GetRoot<Table>(bytes.data());
    }
  }
  throw EventFault(fmt::format("expected a sound table {}, got another", identifier));
}

/// A packet as it lies in the file, or as the table of packets tells of it.
struct PacketPlace {
  std::int64_t byte = 0;  ///< where its content begins
  std::int64_t size_bytes = 0;
  int stream = 0;
  std::int64_t count = -1;  ///< of events or frames; -1: it is of neither
  // Of events, if there are any:
  std::int64_t begin_us = 0;
  std::int64_t end_us = 0;

  std::int64_t end() const { return byte + size_bytes; }
  std::string text() const {
    return fmt::format("stream {}, {} bytes at byte {}, {} elements, {} to {} µs", stream,
                       size_bytes, byte, count, begin_us, end_us);
  }
};

/// What the table says of a packet must be so; older writers left out all but its place.
void check_packet(const PacketPlace& is, const PacketPlace& told) {
  const bool is_placed =
      told.byte == is.byte && told.stream == is.stream && told.size_bytes == is.size_bytes;
  const bool is_told = is.count >= 0 && told.count != 0;
  const bool is_counted = !is_told || told.count == is.count;
  const bool is_timed =
      !is_told || is.end_us == 0 || (told.begin_us == is.begin_us && told.end_us == is.end_us);
  if (is_placed && is_counted && is_timed) return;
  throw EventFault("expected the packet in the table as it is, " + is.text() + ", got " +
                   told.text());
}

double seconds(std::int64_t time_us) { return static_cast<double>(time_us) / 1e6; }

void check_time(std::int64_t time_us) {
  if (time_us >= 0 && time_us < kTimesEnd) return;
  throw EventFault(fmt::format("expected a time of 0..{} µs, got {} µs", kTimesEnd - 1, time_us));
}

/// The same of an event behind another.
void check_order(std::int64_t time_us, std::int64_t last_us) {
  check_time(time_us);
  if (time_us >= last_us) return;
  throw EventFault(
      fmt::format("expected times that never decrease, got {} µs after {} µs", time_us, last_us));
}

/// The file, and how its packets are packed.
class Aedat4File {
 public:
  explicit Aedat4File(const std::filesystem::path& path) : file_(path) {}

  const std::string& name() const { return file_.name(); }
  std::int64_t size_bytes() const { return file_.end_byte(); }
  void set_compression(int compression) { compression_ = compression; }

  std::string read(std::int64_t begin, std::int64_t end) const {
    check_size(end - begin);
    return file_.read_between(begin, end);
  }

  std::string unpack(std::string bytes) const {
    if (compression_ == 0) return bytes;
    return compression_ <= 2 ? unpack_lz4(bytes) : unpack_zstd(bytes);
  }

  /// What is in a packet, whose stream and size must lie in front of it.
  std::string content(const PacketPlace& packet) const {
    check_size(packet.size_bytes);
    std::string bytes = file_.read_between(packet.byte - kPacketHeaderBytes, packet.end());
    PacketPlace is = packet;
    is.stream = number_at<std::int32_t>(bytes, 0);
    is.size_bytes = number_at<std::int32_t>(bytes, 4);
    check_packet(is, packet);
    bytes.erase(0, kPacketHeaderBytes);
    return unpack(std::move(bytes));
  }

  /// Runs `read`; a fault in it is of what lies at `byte`.
  template <class Read>
  auto at(std::int64_t byte, Read read) const {
    try {
      return read();
    } catch (const EventFault& fault) {
      refuse(fault.what(), byte);
    }
  }

  [[noreturn]] void refuse(const std::string& fault, std::int64_t byte) const {
    throw InputError(fmt::format("{}, in {} (byte {})", fault, name(), byte));
  }

  /// Reads a packet, whose first event is the recording's `first` and not before `last_us`. What
  /// was not known of it is known then; what was must be so.
  CompactEvents events(PacketPlace& packet, std::int64_t first, std::int64_t last_us) const {
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
        try {
          check_order(event.t_us(), last_us);
        } catch (const EventFault& fault) {
          throw InputError(fmt::format("{}, in {} (event {})", fault.what(), name(), first + i));
        }
        last_us = event.t_us();
        if (i == 0) is.begin_us = last_us;
        is.end_us = last_us;
        events.push_back({static_cast<double>(event.x()), static_cast<double>(event.y()),
                          seconds(last_us), static_cast<double>(event.on())});
      }
      if (packet.count >= 0) check_packet(is, packet);
      packet = is;
      return events;
    });
  }

  struct Frame {
    std::int64_t time_us = 0;
    bool is_grey = true;
    GreyImage image;
  };

  Frame frame(const PacketPlace& packet, ImageSize size) const {
    return at(packet.byte, [&] {
      std::string bytes = content(packet);
      const aedat4::Frame& table = table_of<aedat4::Frame>(bytes, "FRME");
      const std::int64_t begin_us = table.exposure_begin_us();
      const std::int64_t end_us = table.exposure_end_us();
      Frame frame;
      frame.time_us = table.t_us();
      if (begin_us != 0 || end_us != 0) {
        check_time(begin_us);
        check_time(end_us);
        if (end_us < begin_us) {
          throw EventFault(fmt::format("expected an exposure that ends at {} µs or later, got {}",
                                       begin_us, end_us));
        }
        frame.time_us = begin_us + (end_us - begin_us) / 2;
      }
      check_time(frame.time_us);
      const ImageSize stored{table.height(), table.width()};
      if (stored != size || table.left() != 0 || table.top() != 0) {
        throw EventFault(fmt::format("expected a frame of {} at 0, 0, got {} at {}, {}",
                                     to_string(size), to_string(stored), table.left(),
                                     table.top()));
      }
      const int type = table.format();
      if (type != CV_8UC1 && type != CV_8UC3 && type != CV_8UC4) {
        throw EventFault(fmt::format("expected pixels of OpenCV's type {}, {} or {}, got {}",
                                     CV_8UC1, CV_8UC3, CV_8UC4, type));
      }
      const std::size_t count = table.pixels() ? table.pixels()->size() : 0;
      if (count != size.pixel_count() * CV_MAT_CN(type)) {
        throw EventFault(fmt::format("expected {} bytes of pixels, got {}",
                                     size.pixel_count() * CV_MAT_CN(type), count));
      }
      frame.is_grey = type == CV_8UC1;
      frame.image = {size, std::vector<std::uint8_t>(size.pixel_count())};
      const std::uint8_t* const pixels = table.pixels()->data();
      if (frame.is_grey) {
        std::copy_n(pixels, count, frame.image.pixels.begin());
      } else {
        const cv::Mat colour(size.height, size.width, type, const_cast<std::uint8_t*>(pixels));
        cv::Mat grey(size.height, size.width, CV_8UC1, frame.image.pixels.data());
        cv::cvtColor(colour, grey, type == CV_8UC3 ? cv::COLOR_BGR2GRAY : cv::COLOR_BGRA2GRAY);
      }
      return frame;
    });
  }

 private:
  static void check_size(std::int64_t size_bytes) {
    if (size_bytes <= static_cast<std::int64_t>(kMostBytes)) return;
    throw EventFault(fmt::format("expected at most {} bytes, got {}", kMostBytes, size_bytes));
  }

  InputFile file_;
  int compression_ = 0;
};

// ---- What the header says

struct Stream {
  std::string type;
  ImageSize size;
};

struct Header {
  std::int64_t end_byte = 0;    ///< where the packets begin
  std::int64_t table_byte = 0;  ///< -1: there is no table
  int compression = 0;
  std::map<int, Stream> streams;
};

/// The streams that the XML tells of: its node outInfo has a node for each, named by its number.
std::map<int, Stream> streams_of(const std::string& xml) {
  pugi::xml_document document;
  if (const auto parsed = document.load_buffer(xml.data(), xml.size()); !parsed) {
    throw EventFault(
        fmt::format("expected XML of the streams, got none ({})", parsed.description()));
  }
  std::map<int, Stream> streams;
  const auto attribute = [](const pugi::xml_node& node, const char* key) {
    return node.find_child_by_attribute("attr", "key", key).text();
  };
  for (const pugi::xml_node& node :
       document.child("dv").find_child_by_attribute("node", "name", "outInfo").children("node")) {
    const pugi::xml_node info = node.find_child_by_attribute("node", "name", "info");
    const int number = node.attribute("name").as_int(-1);
    const Stream stream{attribute(node, "typeIdentifier").as_string(),
                        {attribute(info, "sizeY").as_int(), attribute(info, "sizeX").as_int()}};
    if (number < 0 || !streams.emplace(number, stream).second) {
      throw EventFault(
          fmt::format("expected streams of different numbers, got another, {}", number));
    }
  }
  return streams;
}

Header read_header(const Aedat4File& file) {
  constexpr auto kLine = static_cast<std::int64_t>(kFirstLine.size());
  const std::string start = file.read(0, std::min(kLine + 4, file.size_bytes()));
  if (!start.starts_with(kFirstLine) || std::ssize(start) < kLine + 4) {
    file.refuse("expected \"#!AER-DAT4.0\" and a header, got another file", 0);
  }
  Header header;
  header.end_byte = kLine + 4 + number_at<std::uint32_t>(start, kFirstLine.size());
  if (header.end_byte > file.size_bytes()) {
    file.refuse(fmt::format("expected a header up to byte {}, got a file of {} bytes",
                            header.end_byte, file.size_bytes()),
                kLine);
  }
  return file.at(kLine, [&] {
    std::string bytes = file.read(kLine, header.end_byte);
    const auto& table = table_of<aedat4::Header>(bytes, "IOHE");
    header.compression = table.compression();
    header.table_byte = table.table_byte();
    if (header.compression < 0 || header.compression > 4) {
      throw EventFault(fmt::format("expected a compression 0..4, got {}", header.compression));
    }
    if (header.table_byte != -1 &&
        (header.table_byte < header.end_byte || header.table_byte > file.size_bytes())) {
      throw EventFault(fmt::format("expected a table of packets at a byte {}..{}, got one at {}",
                                   header.end_byte, file.size_bytes(), header.table_byte));
    }
    header.streams = streams_of(table.info() ? table.info()->str() : std::string());
    return header;
  });
}

/// The number of the one stream of a type; -1 if there is none.
int only_stream(const Header& header, std::string_view type) {
  int found = -1;
  for (const auto& [number, stream] : header.streams) {
    if (stream.type != type) continue;
    if (found >= 0) {
      throw EventFault(
          fmt::format("expected one stream of {}, got several ({} and {})", type, found, number));
    }
    found = number;
  }
  return found;
}

// ---- The packets

/// The packets that the file's table tells of, in the file's order.
std::vector<PacketPlace> read_table(const Aedat4File& file, std::int64_t table_byte) {
  std::string bytes = file.unpack(file.read(table_byte, file.size_bytes()));
  std::vector<PacketPlace> told;
  const auto* const entries = table_of<aedat4::PacketTable>(bytes, "FTAB").packets();
  for (flatbuffers::uoffset_t i = 0; entries && i < entries->size(); ++i) {
    const aedat4::PacketEntry& entry = *entries->Get(i);
    const aedat4::Packet nowhere(-1, -1);
    const aedat4::Packet& packet = entry.packet() ? *entry.packet() : nowhere;
    told.push_back({entry.byte(), packet.size_bytes(), packet.stream(), entry.count(),
                    entry.begin_us(), entry.end_us()});
  }
  std::ranges::stable_sort(told, {}, &PacketPlace::byte);
  return told;
}

/// Where the packets are, in the file's order. Those that `told` has follow each other as it says,
/// which is looked at when they are read.
std::vector<PacketPlace> find_packets(const Aedat4File& file, const Header& header,
                                      const std::vector<PacketPlace>& told,
                                      std::vector<std::string>& notes) {
  const bool has_table = header.table_byte != -1;
  const std::int64_t end = has_table ? header.table_byte : file.size_bytes();
  std::vector<PacketPlace> packets;
  for (std::int64_t byte = header.end_byte; byte < end;) {
    PacketPlace packet{byte + kPacketHeaderBytes};
    const std::size_t number = packets.size();
    if (number < told.size() && told[number].byte == packet.byte &&
        header.streams.contains(told[number].stream) && told[number].size_bytes > 0) {
      packet.stream = told[number].stream;
      packet.size_bytes = told[number].size_bytes;
    } else if (packet.byte <= end) {
      const std::string bytes = file.read(byte, packet.byte);
      packet.stream = number_at<std::int32_t>(bytes, 0);
      packet.size_bytes = number_at<std::int32_t>(bytes, 4);
    }
    if (packet.byte <= end && (!header.streams.contains(packet.stream) || packet.size_bytes <= 0)) {
      file.refuse(fmt::format("expected a packet of a stream that the header tells of, got {} "
                              "bytes of stream {}",
                              packet.size_bytes, packet.stream),
                  byte);
    }
    if (packet.end() > end) {
      const std::string cut = fmt::format("expected a packet of {} bytes, got {}",
                                          kPacketHeaderBytes + packet.size_bytes, end - byte);
      if (has_table) file.refuse(cut, byte);
      notes.push_back(fmt::format("the last packet is cut off and left out: {}, in {} (byte {})",
                                  cut, file.name(), byte));
      break;
    }
    byte = packet.end();
    packets.push_back(packet);
  }
  if (has_table && told.size() != packets.size()) {
    file.refuse(fmt::format("expected a table of {} packets, as many as there are, got {}",
                            packets.size(), told.size()),
                header.table_byte);
  }
  for (std::size_t i = 0; i < told.size(); ++i) {
    file.at(header.table_byte, [&] { check_packet(packets[i], told[i]); });
  }
  return packets;
}

class Aedat4Events final : public EventParts {
 public:
  explicit Aedat4Events(std::shared_ptr<const Aedat4File> file)
      : EventParts(file->name()), file_(std::move(file)) {}

  /// A packet behind those added before. It is read now unless the table tells, of a packet that
  /// fits behind them, how many events of which times it has.
  void add(PacketPlace packet, const PacketPlace* told) {
    constexpr auto kMostEvents = static_cast<std::int64_t>(kMostBytes / sizeof(aedat4::Event));
    if (told && told->count > 0 && told->count <= kMostEvents && told->begin_us >= last_us_ &&
        told->end_us >= told->begin_us && told->end_us < kTimesEnd) {
      packet = *told;
      packets_.push_back(packet);
      add_part(packet.count, seconds(packet.begin_us));
    } else {
      CompactEvents events = file_->events(packet, count(), last_us_);
      if (told) file_->at(packet.byte, [&] { check_packet(packet, *told); });
      if (packet.count == 0) return;
      packets_.push_back(packet);
      add_part(std::move(events));
    }
    last_us_ = packet.end_us;
  }

 private:
  CompactEvents read_part(std::size_t part) const override {
    PacketPlace packet = packets_[part];
    return file_->events(packet, first_of(part), part == 0 ? 0 : packets_[part - 1].end_us);
  }

  std::shared_ptr<const Aedat4File> file_;
  std::vector<PacketPlace> packets_;  ///< those with events
  std::int64_t last_us_ = 0;
};

class Aedat4Frames final : public FrameStore {
 public:
  Aedat4Frames(std::shared_ptr<const Aedat4File> file, ImageSize size)
      : file_(std::move(file)), size_(size) {}

  /// Reads a packet; false if its frame is in colour.
  bool add(PacketPlace packet, const PacketPlace* told) {
    const Aedat4File::Frame frame = file_->frame(packet, size_);
    packet.count = 1;
    if (told) file_->at(packet.byte, [&] { check_packet(packet, *told); });
    packets_.push_back(packet);
    times_s_.push_back(seconds(frame.time_us));
    return frame.is_grey;
  }

  const std::vector<double>& times_s() const override { return times_s_; }

  GreyImage read(std::int64_t index) const override {
    return file_->frame(packets_[static_cast<std::size_t>(index)], size_).image;
  }

 private:
  std::shared_ptr<const Aedat4File> file_;
  ImageSize size_;
  std::vector<PacketPlace> packets_;
  std::vector<double> times_s_;
};

}  // namespace

StoredParts open_aedat4(const std::filesystem::path& path) {
  const auto file = std::make_shared<Aedat4File>(path);
  const Header header = read_header(*file);
  file->set_compression(header.compression);
  StoredParts parts{file->name(), {}, nullptr};
  const auto [event_stream, frame_stream] = file->at(std::ssize(kFirstLine), [&] {
    const std::pair streams(only_stream(header, "EVTS"), only_stream(header, "FRME"));
    if (streams.first < 0) throw EventFault("expected a stream of events (EVTS), got none");
    parts.size = header.streams.at(streams.first).size;
    if (std::min(parts.size.width, parts.size.height) < 1 ||
        std::max(parts.size.width, parts.size.height) > kMostSensorSide) {
      throw EventFault("expected sizeX and sizeY of the events' stream in 1.." +
                       std::to_string(kMostSensorSide) + ", got " + to_string(parts.size));
    }
    return streams;
  });

  if (header.table_byte == -1) {
    parts.notes.push_back(
        "there is no table of packets, as after a camera was unplugged: what is "
        "there is read, in " +
        file->name());
  }
  std::vector<PacketPlace> told;
  if (header.table_byte != -1) {
    told = file->at(header.table_byte, [&] { return read_table(*file, header.table_byte); });
  }
  const std::vector<PacketPlace> packets = find_packets(*file, header, told, parts.notes);
  auto events = std::make_unique<Aedat4Events>(file);
  auto frames = std::make_unique<Aedat4Frames>(file, parts.size);
  bool are_grey = true;
  for (std::size_t i = 0; i < packets.size(); ++i) {
    const PacketPlace* const entry = told.empty() ? nullptr : &told[i];
    if (packets[i].stream == event_stream) events->add(packets[i], entry);
    if (packets[i].stream == frame_stream) are_grey &= frames->add(packets[i], entry);
  }
  if (!are_grey) parts.notes.push_back("frames in colour are made grey, in " + file->name());
  parts.events = std::move(events);
  if (!frames->times_s().empty()) parts.frames = std::move(frames);
  return parts;
}

constinit const RecordingReader kAedat4Reader{
    .format = RecordingFormat::kAedat4,
    .fits = [](const RecordingInput& input,
               const RecordingOptions&) { return input.beginning().starts_with(kFirstLine); },
    .open = [](const std::filesystem::path& path,
               const RecordingOptions&) { return make_stored_recording(open_aedat4(path)); }};

}  // namespace eventgan
