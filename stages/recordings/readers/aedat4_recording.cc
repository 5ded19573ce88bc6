#include "stages/recordings/readers/detail/aedat4_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/detail/aedat4_file.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "stages/recordings/readers/detail/placed_frames.h"
#include "stages/recordings/readers/detail/recording_reader.h"

namespace eventgan {
namespace {

/// The numbers of the streams of a type, ascending.
std::vector<int> streams_of(const Aedat4File::Header& header, std::string_view type) {
  std::vector<int> numbers;
  for (const auto& [number, stream] : header.streams) {
    if (stream.type == type) numbers.push_back(number);
  }
  return numbers;
}

struct ReadStreams {
  int events = -1;
  int frames = -1;  ///< -1: there are none
};

/// The first stream of events, or the one that the options name, and the frames behind it in the
/// camera's order, which are of the same one.
ReadStreams choose_streams(const Aedat4File& file, const RecordingOptions& options,
                           std::vector<std::string>& notes) {
  const std::vector<int> events = streams_of(file.header(), "EVTS");
  const std::vector<int> frames = streams_of(file.header(), "FRME");
  if (events.empty()) throw EventFault("expected a stream of events (EVTS), got none");
  ReadStreams read{options.stream.value_or(events[0])};
  if (std::ranges::find(events, read.events) == events.end()) {
    throw EventFault(
        fmt::format("expected the manifest's \"stream\" to be one of events, {}, got {}",
                    fmt::join(events, ", "), read.events));
  }
  if (!frames.empty()) {
    const auto behind = std::ranges::upper_bound(frames, read.events);
    read.frames = behind == frames.end() ? frames[0] : *behind;
  }
  if (events.size() > 1 && !options.stream) {
    notes.push_back(fmt::format(
        "of several streams of events ({}) the first is taken: \"stream\" names another, in {}",
        fmt::join(events, ", "), file.name()));
  }
  if (frames.size() > 1) {
    notes.push_back(fmt::format("of several streams of frames ({}) {} is taken, in {}",
                                fmt::join(frames, ", "), read.frames, file.name()));
  }
  return read;
}

class Aedat4Events final : public EventParts {
 public:
  explicit Aedat4Events(std::shared_ptr<const Aedat4File> file)
      : EventParts(file->name()), file_(std::move(file)) {}

  /// A packet behind those added before. It is read now unless the table tells how many events of
  /// which times it has.
  void add(PacketPlace packet, const PacketPlace* told) {
    if (told && told->may_have_events()) {
      packet = *told;
      packets_.push_back(packet);
      add_part(packet.count, packet.begin_s(), packet.end_s());
    } else {
      CompactEvents events = file_->events(packet);
      if (packet.count == 0) return;
      packets_.push_back(packet);
      add_part(std::move(events));
    }
  }

 private:
  CompactEvents read_part(std::size_t part) const override {
    PacketPlace packet = packets_[part];
    return file_->events(packet);
  }

  std::shared_ptr<const Aedat4File> file_;
  std::vector<PacketPlace> packets_;  ///< those with events
};

/// The packets, and what the table tells of each; nothing if it is of no use, which a note says.
struct FoundPackets {
  std::vector<PacketPlace> packets;
  std::vector<PacketPlace> told;
};

FoundPackets find_packets(const Aedat4File& file, int event_stream,
                          std::vector<std::string>& notes) {
  FoundPackets found;
  try {
    found.told = file.read_table();
    found.packets = file.find_packets(found.told, notes);
    file.check_table(found.packets, found.told, event_stream);
    return found;
  } catch (const InputError& error) {
    if (found.told.empty() && file.header().table_byte == -1) throw;
    notes.push_back(
        fmt::format("the table of packets is not used, all are read (table: {})", error.what()));
  }
  return {file.find_packets({}, notes), {}};
}

}  // namespace

StoredParts open_aedat4(const std::filesystem::path& path, const RecordingOptions& options) {
  const auto file = std::make_shared<Aedat4File>(path);
  StoredParts parts{file->name(), {}, nullptr};
  const ReadStreams streams = file->at(std::ssize(kAedat4FirstLine), [&] {
    const ReadStreams chosen = choose_streams(*file, options, parts.notes);
    const ImageSize told = file->header().streams.at(chosen.events).size;
    const bool is_told = std::min(told.width, told.height) >= 1 &&
                         std::max(told.width, told.height) <= kMostSensorSide;
    parts.size = sensor_size(is_told ? std::optional(told) : std::nullopt, options.sensor, parts);
    return chosen;
  });

  if (file->header().table_byte == -1) {
    parts.notes.push_back(
        "there is no table of packets, as after a camera was unplugged: what is "
        "there is read, in " +
        file->name());
  }
  const auto [packets, told] = find_packets(*file, streams.events, parts.notes);
  auto events = std::make_unique<Aedat4Events>(file);
  auto frames = std::make_unique<PlacedFrames<PacketPlace>>(
      file->name(),
      [file, size = parts.size](const PacketPlace& packet) { return file->frame(packet, size); });
  for (std::size_t i = 0; i < packets.size(); ++i) {
    if (packets[i].stream == streams.events)
      events->add(packets[i], told.empty() ? nullptr : &told[i]);
    if (packets[i].stream == streams.frames) frames->add(packets[i]);
  }
  parts.events = std::move(events);
  if (!frames->times_s().empty()) {
    parts.frames = std::move(frames);
  } else {
    std::ranges::move(frames->notes(), std::back_inserter(parts.notes));
  }
  return parts;
}

constinit const RecordingReader kAedat4Reader{
    .format = RecordingFormat::kAedat4,
    .fits = [](const RecordingInput& input,
               const RecordingOptions&) { return input.beginning().starts_with(kAedat4FirstLine); },
    .open =
        [](const std::filesystem::path& path, const RecordingOptions& options) {
          return make_stored_recording(open_aedat4(path, options));
        }};

}  // namespace eventgan
