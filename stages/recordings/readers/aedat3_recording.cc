#include "stages/recordings/readers/detail/aedat3_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <iterator>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/order/packed_bytes.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "stages/recordings/readers/detail/image_frames.h"
#include "stages/recordings/readers/detail/open_files.h"
#include "stages/recordings/readers/detail/placed_frames.h"
#include "stages/recordings/readers/detail/recording_reader.h"

namespace eventgan {
namespace {

constexpr std::string_view kFirstLine = "#!AER-DAT3.1";
constexpr std::string_view kLastLine = "#!END-HEADER";

// ---- What lies in the file, little-endian

struct PacketHeader {
  std::uint16_t type = 0;
  std::uint16_t source = 0;
  std::uint32_t event_bytes = 0;
  std::uint32_t time_byte = 0;
  std::uint32_t overflows = 0;  ///< of the times' 31 bits
  std::uint32_t capacity = 0;
  std::uint32_t count = 0;
  std::uint32_t valid_count = 0;
};
static_assert(sizeof(PacketHeader) == 28, "it is copied as it is stored");

enum PacketType : std::uint16_t { kPolarityPacket = 1, kFrame = 2, kPacked = 0x8000 };

struct PolarityEvent {
  std::uint32_t data = 0;
  std::uint32_t time_us = 0;
};

struct FrameHeader {
  std::uint32_t info = 0;
  std::int32_t begin_us = 0, end_us = 0;
  std::int32_t exposure_begin_us = 0, exposure_end_us = 0;
  std::int32_t width = 0, height = 0, left = 0, top = 0;
};
static_assert(sizeof(FrameHeader) == 36, "it is copied as it is stored");

/// Events of one type and source.
struct Packet {
  std::int64_t byte = 0;  ///< of the first
  std::int64_t event_bytes = 0;
  std::int64_t count = 0;
  std::int64_t before_us = 0;  ///< added to their times

  std::int64_t end() const { return byte + event_bytes * count; }
};

/// Of the cameras that cAER knows, by how their names begin.
constexpr std::pair<std::string_view, ImageSize> kCameras[] = {
    {"DVS128", {128, 128}},   {"eDVS", {128, 128}},     {"DAVIS128", {128, 128}},
    {"DAVIS208", {192, 208}}, {"DAVIS240", {180, 240}}, {"DAVIS346", {260, 346}},
    {"DAVIS640", {480, 640}}, {"DAVISHet", {480, 640}}, {"DAVISRGB", {480, 640}}};

class Aedat3File {
 public:
  /// Finds the packets.
  Aedat3File(const std::filesystem::path& path, std::vector<std::string>& notes) : file_(path) {
    read_header();
    find_packets(notes);
  }

  const std::string& name() const { return file_.name(); }
  /// The packets of a type, by their sources.
  const std::map<int, std::vector<Packet>>& packets(PacketType type) const {
    return type == kFrame ? frames_ : events_;
  }
  /// The camera of a source; none: its name tells no size.
  std::optional<ImageSize> camera_size(int source) const {
    const auto camera = cameras_.find(source);
    return camera == cameras_.end() ? std::nullopt : std::optional(camera->second);
  }

  /// As RecordingFile::at.
  template <class Read>
  auto at(std::int64_t byte, Read read) const {
    return file_.at(byte, read);
  }

  /// Adds the invalid ones to `left_out`.
  CompactEvents events(const Packet& packet, std::int64_t& left_out) const {
    return at(packet.byte, [&] {
      const std::string bytes = file_.read_between(packet.byte, packet.end());
      CompactEvents events;
      events.reserve(static_cast<std::size_t>(packet.count));
      for (std::string_view rest = bytes; !rest.empty();) {
        PolarityEvent event;
        unpack(rest, event);
        if ((event.data & 1) == 0) {
          ++left_out;
          continue;
        }
        events.push_back(
            {static_cast<double>(event.data >> 17), static_cast<double>(event.data >> 2 & 0x7fff),
             seconds(packet, event.time_us), static_cast<double>(event.data >> 1 & 1)});
      }
      return events;
    });
  }

  PlacedFrame frame(const Packet& place, ImageSize size) const {
    return at(place.byte, [&] {
      const std::string bytes = file_.read_between(place.byte, place.end());
      std::string_view pixels = bytes;
      FrameHeader header;
      unpack(pixels, header);
      const std::size_t channels = header.info >> 1 & 7;
      const ImageSize stored{header.height, header.width};
      if ((header.info & 1) == 0) throw EventFault("expected a valid frame, got another");
      if (stored != size || header.left != 0 || header.top != 0) {
        throw EventFault(fmt::format("expected a frame of {} at 0, 0, got {} at {}, {}",
                                     to_string(size), to_string(stored), header.left, header.top));
      }
      if (channels != 1 && channels != 3 && channels != 4) {
        throw EventFault(fmt::format("expected 1, 3 or 4 channels, got {}", channels));
      }
      if (pixels.size() < 2 * channels * size.pixel_count()) {
        throw EventFault(fmt::format("expected {} bytes of pixels, got {}",
                                     2 * channels * size.pixel_count(), pixels.size()));
      }
      if (header.exposure_begin_us < 0 || header.exposure_end_us < header.exposure_begin_us) {
        throw EventFault(fmt::format("expected an exposure that ends at {} µs or later, got {}",
                                     header.exposure_begin_us, header.exposure_end_us));
      }
      const auto exposure_us = static_cast<std::uint32_t>(
          header.exposure_begin_us + (header.exposure_end_us - header.exposure_begin_us) / 2);
      ColourFrame colour{size, std::vector<std::uint8_t>(3 * size.pixel_count())};
      for (std::size_t i = 0; i < colour.bgr.size(); ++i) {
        const std::size_t channel = channels == 1 ? 0 : 2 - i % 3;  // red comes first
        colour.bgr[i] = static_cast<std::uint8_t>(pixels[2 * (i / 3 * channels + channel) + 1]);
      }
      bool is_colour = false;
      GreyImage grey = grey_of(colour, is_colour);
      return PlacedFrame{seconds(place, exposure_us), is_colour, true, std::move(grey)};
    });
  }

  [[noreturn]] void refuse(const std::string& fault, std::int64_t byte) const {
    file_.refuse(fault, byte);
  }

 private:
  static double seconds(const Packet& packet, std::uint32_t time_us) {
    if (time_us >> 31 != 0) {
      throw EventFault(fmt::format("expected a time of 31 bits, got {} µs", time_us));
    }
    return static_cast<double>(packet.before_us + time_us) / 1e6;
  }

  /// Lines "#...", up to "#!END-HEADER" or to what is no such line.
  void read_header() {
    constexpr std::int64_t kMostBytes = std::int64_t{1} << 20;
    const std::string text = file_.read_between(0, std::min(kMostBytes, file_.end_byte()));
    if (!text.starts_with(kFirstLine)) refuse("expected \"#!AER-DAT3.1\", got another file", 0);
    std::size_t at = 0;
    while (at < text.size() && text[at] == '#') {
      const std::size_t end = text.find('\n', at);
      if (end == std::string::npos) {
        refuse("expected a line of text, got no end of it", static_cast<std::int64_t>(at));
      }
      const std::string_view line = std::string_view(text).substr(at, end - at);
      at = end + 1;
      constexpr std::string_view kSource = "#Source ";
      if (line.starts_with(kLastLine)) break;
      if (line.starts_with(kSource)) add_camera(line.substr(kSource.size()));
    }
    first_byte_ = static_cast<std::int64_t>(at);
  }

  /// "1: DAVIS240C"
  void add_camera(std::string_view source) {
    int number = 0;
    const auto [stop, error] =
        std::from_chars(source.data(), source.data() + source.size(), number);
    std::string_view camera = source.substr(static_cast<std::size_t>(stop - source.data()));
    if (error != std::errc() || !camera.starts_with(": ")) return;
    camera.remove_prefix(2);
    for (const auto& [name, size] : kCameras) {
      if (camera.starts_with(name)) cameras_.emplace(number, size);
    }
  }

  void find_packets(std::vector<std::string>& notes) {
    std::map<int, std::int64_t> others;
    for (std::int64_t byte = first_byte_; byte < file_.end_byte();) {
      constexpr std::int64_t kHeaderBytes = sizeof(PacketHeader);
      const std::string bytes =
          file_.read_between(byte, std::min(byte + kHeaderBytes, file_.end_byte()));
      std::string_view rest = bytes;
      PacketHeader header;
      const bool is_whole = unpack(rest, header);
      const Packet packet{byte + kHeaderBytes, header.event_bytes, header.count,
                          std::int64_t{header.overflows} << 31};
      if (is_whole) check(header, byte);
      if (!is_whole || packet.count > (file_.end_byte() - packet.byte) / packet.event_bytes) {
        const std::string cut =
            fmt::format("expected a packet of {} bytes, got {}",
                        kHeaderBytes + packet.event_bytes * packet.count, file_.end_byte() - byte);
        if (byte == first_byte_) refuse(cut, byte);
        notes.push_back(fmt::format("the last packet is cut off and left out: {}, in {} (byte {})",
                                    cut, name(), byte));
        break;
      }
      if (header.type == kPolarityPacket) {
        events_[header.source].push_back(packet);
      } else if (header.type == kFrame) {
        frames_[header.source].push_back(packet);
      } else {
        others[header.type] += packet.count;
      }
      byte = packet.end();
    }
    for (const auto& [type, count] : others) {
      notes.push_back(
          fmt::format("events of type {} are passed over: {}, in {}", type, count, name()));
    }
  }

  void check(const PacketHeader& header, std::int64_t byte) const {
    constexpr std::uint32_t kMostBytes = std::uint32_t{1} << 28;
    constexpr std::uint32_t kMostOverflows = std::uint32_t{1} << 20;
    if ((header.type & kPacked) != 0) {
      refuse("expected packets as they are (\"#Format: RAW\"), got packed ones", byte);
    }
    const bool fits = header.type == kPolarityPacket ? header.event_bytes == sizeof(PolarityEvent)
                      : header.type == kFrame        ? header.event_bytes >= sizeof(FrameHeader)
                                                     : header.event_bytes > 0;
    if (fits && header.event_bytes <= kMostBytes && header.overflows <= kMostOverflows) return;
    refuse(fmt::format("expected a packet, got one of type {} with events of {} bytes and {} "
                       "overflows of their times",
                       header.type, header.event_bytes, header.overflows),
           byte);
  }

  RecordingFile file_;
  std::int64_t first_byte_ = 0;  ///< behind the lines
  std::map<int, ImageSize> cameras_;
  std::map<int, std::vector<Packet>> events_, frames_;
};

class Aedat3Events final : public EventParts {
 public:
  explicit Aedat3Events(std::shared_ptr<const Aedat3File> file)
      : EventParts(file->name()), file_(std::move(file)) {}

  void add(Packet packet) {
    constexpr std::int64_t kEventsPerPart = 1 << 17;
    for (std::int64_t left = packet.count; left > 0; left -= packet.count) {
      packet.count = std::min(left, kEventsPerPart);
      CompactEvents events = file_->events(packet, left_out_);
      if (events.size() > 0) parts_.push_back(packet);
      add_part(std::move(events));
      packet.byte = packet.end();
    }
  }

  std::int64_t left_out() const { return left_out_; }

 private:
  CompactEvents read_part(std::size_t part) const override {
    std::int64_t left_out = 0;
    return file_->events(parts_[part], left_out);
  }

  std::shared_ptr<const Aedat3File> file_;
  std::vector<Packet> parts_;
  std::int64_t left_out_ = 0;
};

}  // namespace

StoredParts open_aedat3(const std::filesystem::path& path, const RecordingOptions& options) {
  std::vector<std::string> notes;
  const auto file = std::make_shared<const Aedat3File>(path, notes);
  const auto& sources = file->packets(kPolarityPacket);
  std::vector<int> numbers;
  for (const auto& [number, packets] : sources) numbers.push_back(number);
  if (numbers.empty()) numbers.push_back(options.stream.value_or(0));
  const int source = options.stream.value_or(numbers[0]);
  if (std::ranges::find(numbers, source) == numbers.end()) {
    file->refuse(fmt::format("expected the manifest's \"stream\" to be a source of events, {}, "
                             "got {}",
                             fmt::join(numbers, ", "), source),
                 0);
  }
  if (numbers.size() > 1 && !options.stream) {
    notes.push_back(fmt::format(
        "of several sources of events ({}) the first is taken: \"stream\" names another, in {}",
        fmt::join(numbers, ", "), file->name()));
  }
  StoredParts parts{file->name(), {}, nullptr};
  parts.notes = std::move(notes);
  parts.size = sensor_size(file->camera_size(source), options.sensor, parts);

  auto events = std::make_unique<Aedat3Events>(file);
  if (const auto found = sources.find(source); found != sources.end()) {
    for (const Packet& packet : found->second) events->add(packet);
  }
  if (events->left_out() > 0) {
    parts.notes.push_back(fmt::format("events marked invalid are left out: {}, in {}",
                                      events->left_out(), file->name()));
  }
  parts.events = std::move(events);
  auto frames = std::make_unique<PlacedFrames<Packet>>(
      file->name(),
      [file, size = parts.size](const Packet& frame) { return file->frame(frame, size); });
  if (const auto found = file->packets(kFrame).find(source); found != file->packets(kFrame).end()) {
    for (Packet place : found->second) {
      const std::int64_t end = place.end();
      for (place.count = 1; place.byte < end; place.byte += place.event_bytes) frames->add(place);
    }
  }
  if (frames->times_s().empty()) {
    std::ranges::move(frames->notes(), std::back_inserter(parts.notes));
  } else {
    parts.frames = std::move(frames);
  }
  return parts;
}

constinit const RecordingReader kAedat3Reader{
    .format = RecordingFormat::kAedat3,
    .fits = [](const RecordingInput& input,
               const RecordingOptions&) { return input.beginning().starts_with(kFirstLine); },
    .open =
        [](const std::filesystem::path& path, const RecordingOptions& options) {
          return make_stored_recording(open_aedat3(path, options));
        }};

}  // namespace eventgan
