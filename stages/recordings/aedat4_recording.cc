#include "stages/recordings/detail/aedat4_recording.h"

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/recordings/detail/aedat4_file.h"
#include "stages/recordings/detail/event_parts.h"
#include "stages/recordings/detail/recording_reader.h"

namespace eventgan {
namespace {

/// The number of the one stream of a type; -1 if there is none.
int only_stream(const Aedat4File::Header& header, std::string_view type) {
  int found = -1;
  for (const auto& [number, stream] : header.streams) {
    if (stream.type != type) continue;
    if (found >= 0) {
      throw EventFault("expected one stream of " + std::string(type) + ", got several (" +
                       std::to_string(found) + " and " + std::to_string(number) + ")");
    }
    found = number;
  }
  return found;
}

class Aedat4Events final : public EventParts {
 public:
  explicit Aedat4Events(std::shared_ptr<const Aedat4File> file)
      : EventParts(file->name()), file_(std::move(file)) {}

  /// A packet behind those added before. It is read now unless the table tells, of a packet that
  /// fits behind them, how many events of which times it has.
  void add(PacketPlace packet, const PacketPlace* told) {
    if (told && told->may_have_events_from(last_us_)) {
      packet = *told;
      packets_.push_back(packet);
      add_part(packet.count, packet.begin_s());
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
    times_s_.push_back(frame.time_s);
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
  const Aedat4File::Header& header = file->header();
  StoredParts parts{file->name(), {}, nullptr};
  const auto [event_stream, frame_stream] = file->at(std::ssize(kAedat4FirstLine), [&] {
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
  const std::vector<PacketPlace> told = file->read_table();
  const std::vector<PacketPlace> packets = file->find_packets(told, parts.notes);
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
               const RecordingOptions&) { return input.beginning().starts_with(kAedat4FirstLine); },
    .open = [](const std::filesystem::path& path,
               const RecordingOptions&) { return make_stored_recording(open_aedat4(path)); }};

}  // namespace eventgan
