#include "stages/recordings/readers/detail/rosbag_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/recently_used.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/order/event_index.h"
#include "stages/recordings/order/packed_bytes.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "stages/recordings/readers/detail/image_frames.h"
#include "stages/recordings/readers/detail/placed_frames.h"
#include "stages/recordings/readers/detail/prophesee_words.h"
#include "stages/recordings/readers/detail/recording_reader.h"
#include "stages/recordings/readers/detail/rosbag_file.h"

namespace eventgan {
namespace {

// ---- Messages

/// How every such message begins.
struct MessageStart {
  std::int64_t stamp_ns = 0;
  ImageSize size;
};

std::int64_t take_time_ns(std::string_view& bytes) {
  constexpr std::uint32_t kSecond = 1'000'000'000;
  const auto seconds = take<std::uint32_t>(bytes), ns = take<std::uint32_t>(bytes);
  if (ns >= kSecond) throw EventFault(fmt::format("expected less than a second in ns, got {}", ns));
  return std::int64_t{seconds} * kSecond + ns;
}

MessageStart take_start(std::string_view& message) {
  take<std::uint32_t>(message);  // its number
  MessageStart start{take_time_ns(message), {}};
  take_text(message);  // the frame of coordinates
  const auto height = take<std::uint32_t>(message), width = take<std::uint32_t>(message);
  constexpr std::uint32_t kMost = kMostSensorSide;
  if (height <= kMost && width <= kMost) {
    start.size = {static_cast<int>(height), static_cast<int>(width)};
  }
  return start;
}

double whole_us(std::int64_t time_ns) { return static_cast<double>(time_ns / 1000) / 1e6; }

/// The rest of an EventPacket, up to its events.
struct PacketStart {
  std::uint64_t time_base_ns = 0;
  std::string_view encoding;
};

PacketStart take_packet_start(std::string_view& message) {
  take<std::uint64_t>(message);  // its number
  PacketStart start{take<std::uint64_t>(message), take_text(message)};
  const auto is_big_endian = take<std::uint8_t>(message);
  if ((start.encoding != "evt3" && start.encoding != "mono") || is_big_endian != 0) {
    throw EventFault(fmt::format("expected an EventPacket in evt3 or mono, got {}{}",
                                 start.encoding, is_big_endian != 0 ? ", big-endian" : ""));
  }
  return start;
}

// ---- Topics

using Topics = std::map<std::string, std::set<std::uint32_t>>;  // and their connections

Topics topics_of(const RosbagFile& bag, MessageKind kind) {
  Topics topics;
  for (const auto& [number, connection] : bag.connections()) {
    if (connection.kind == kind) topics[connection.topic].insert(number);
  }
  return topics;
}

/// The topic of events, or of several the one whose number the options give.
std::string choose_topic(const RosbagFile& bag, const RecordingOptions& options) {
  std::set<std::string> topics;
  for (const MessageKind kind : {MessageKind::kEventArray, MessageKind::kEventPacket}) {
    for (const auto& [topic, connections] : topics_of(bag, kind)) topics.insert(topic);
  }
  if (topics.empty()) {
    std::set<std::string> others;
    for (const auto& [number, connection] : bag.connections()) {
      others.insert(connection.topic + " (" + connection.type + ")");
    }
    throw InputError(fmt::format(
        "expected a topic of events (dvs_msgs/EventArray, event_camera_msgs/EventPacket), got {}, "
        "in {}",
        others.empty() ? "none" : fmt::format("{}", fmt::join(others, ", ")), bag.name()));
  }
  const int chosen = options.stream.value_or(topics.size() == 1 ? 0 : -1);
  if (chosen >= 0 && chosen < std::ssize(topics)) return *std::next(topics.begin(), chosen);
  std::vector<std::string> numbered;
  for (const std::string& topic : topics) {
    numbered.push_back(fmt::format("{} {}", numbered.size(), topic));
  }
  throw InputError(fmt::format(
      "expected \"stream\" in the manifest to be the number of a topic of events ({}), got {}, "
      "in {}",
      fmt::join(numbered, ", "), options.stream ? std::to_string(*options.stream) : "none",
      bag.name()));
}

/// "/davis/left/" of "/davis/left/events"
std::string_view namespace_of(std::string_view topic) {
  return topic.substr(0, topic.rfind('/') + 1);
}

// ---- Events

/// What an event's meaning depends on.
struct BagState {
  WordState words;                                    ///< of evt3
  std::optional<std::int64_t> camera_to_ros_ns = {};  ///< added to the camera's times
  std::int64_t outside = 0;                           ///< events beside the sensor
};

class BagEvents final : public EventParts {
 public:
  BagEvents(std::shared_ptr<const RosbagFile> bag, const std::string& topic, ImageSize size)
      : EventParts(bag->name()), bag_(std::move(bag)), size_(size) {
    for (const auto& [number, connection] : bag_->connections()) {
      if (connection.topic == topic && connection.kind) kinds_.emplace(number, *connection.kind);
    }
  }

  /// The next chunk.
  void add(std::int64_t byte, std::string_view content) {
    const BagState before = state_;
    CompactEvents events;
    try {
      events = decode(byte, content, state_);
    } catch (const InputError&) {
      state_ = before;
      throw;
    }
    if (events.size() == 0) return;
    if (lost_) add_unreadable(std::exchange(lost_, nullptr));
    starts_.push_back({byte, before});
    add_part(std::move(events));
  }

  /// A chunk that cannot be read: what lies between the events around it is unknown.
  void lose(std::exception_ptr error) { lost_ = std::move(error); }

  std::int64_t outside() const { return state_.outside; }
  std::int64_t without_place() const { return state_.words.counts.left_out; }

  void pack_events(std::string& bytes) const {
    pack(bytes, starts_);
    pack(bytes, state_);
    pack_parts(bytes);
  }
  bool unpack_events(std::string_view& bytes) {
    std::vector<Start> starts;
    if (!unpack(bytes, starts) || !unpack(bytes, state_)) return false;
    starts_ = std::move(starts);
    return unpack_parts(bytes, starts_.size());
  }

 private:
  struct Start {
    std::int64_t byte = 0;  ///< of the chunk
    BagState state;
  };

  CompactEvents read_part(std::size_t part) const override {
    BagState state = starts_[part].state;
    return decode(starts_[part].byte, bag_->chunk(starts_[part].byte), state);
  }

  CompactEvents decode(std::int64_t byte, std::string_view content, BagState& state) const {
    CompactEvents events;
    bag_->for_each_message(byte, content,
                           [&](std::uint32_t connection, std::string_view message, std::size_t) {
                             const auto kind = kinds_.find(connection);
                             if (kind == kinds_.end()) return;
                             const MessageStart start = take_start(message);
                             if (kind->second == MessageKind::kEventArray) {
                               take_array(message, state, events);
                             } else {
                               take_packet(message, start.stamp_ns, state, events);
                             }
                           });
    return events;
  }

  void take_array(std::string_view message, BagState& state, CompactEvents& events) const {
    constexpr std::size_t kEventBytes = 13;
    const std::size_t count = take<std::uint32_t>(message);
    if (message.size() != kEventBytes * count) {
      throw EventFault(fmt::format("expected {} events of {} bytes, got {} bytes", count,
                                   kEventBytes, message.size()));
    }
    while (!message.empty()) {
      const auto x = take<std::uint16_t>(message), y = take<std::uint16_t>(message);
      const double time_s = whole_us(take_time_ns(message));
      push(x, y, time_s, take<std::uint8_t>(message), state, events);
    }
  }

  void take_packet(std::string_view message, std::int64_t stamp_ns, BagState& state,
                   CompactEvents& events) const {
    const PacketStart packet = take_packet_start(message);
    std::string_view words = take_text(message);
    const auto time_s = [&](std::int64_t camera_ns) {
      if (!state.camera_to_ros_ns) state.camera_to_ros_ns = stamp_ns - camera_ns;
      return whole_us(camera_ns + *state.camera_to_ros_ns);
    };
    if (packet.encoding == "mono") {
      constexpr std::uint64_t kTimesEndNs = std::uint64_t{1} << 62;
      if (packet.time_base_ns >= kTimesEndNs) {
        throw EventFault(fmt::format("expected a time of less than {} ns, got {}", kTimesEndNs,
                                     packet.time_base_ns));
      }
      while (!words.empty()) {
        const auto word = take<std::uint64_t>(words);
        const std::uint64_t camera_ns = packet.time_base_ns + (word & 0xffffffff);
        push(static_cast<int>(word >> 32 & 0xffff), static_cast<int>(word >> 48 & 0x7fff),
             time_s(static_cast<std::int64_t>(camera_ns)), static_cast<int>(word >> 63), state,
             events);
      }
      return;
    }
    WordEvents decoded;
    while (!words.empty()) {
      const std::size_t count =
          take_evt3(take<std::uint16_t>(words), state.words, /*shifts=*/false, decoded);
      for (std::size_t i = 0; i < count; ++i) {  // all at one time
        push(decoded[i].x, decoded[i].y, time_s(state.words.last_us * 1000), decoded[i].polarity,
             state, events);
      }
    }
  }

  void push(double x, double y, double time_s, double polarity, BagState& state,
            CompactEvents& events) const {
    if (x < size_.width && y < size_.height) {
      events.push_back({x, y, time_s, polarity});
    } else {
      ++state.outside;
    }
  }

  std::shared_ptr<const RosbagFile> bag_;
  ImageSize size_;
  std::map<std::uint32_t, MessageKind> kinds_;  ///< of the topic's connections
  std::vector<Start> starts_;                   ///< of the parts, which have events
  BagState state_;                              ///< behind the last
  std::exception_ptr lost_;
};

/// The size that the topic's first message tells, if any. Throws InputError if there are messages
/// and none of them can be read.
std::optional<ImageSize> size_in_topic(const RosbagFile& bag,
                                       const std::set<std::uint32_t>& topic) {
  std::exception_ptr damage;
  for (const std::int64_t byte : bag.chunks_of(topic)) {
    std::optional<ImageSize> size;
    std::string refused;
    try {
      bag.for_each_message(byte, bag.chunk(byte),
                           [&](std::uint32_t number, std::string_view message, std::size_t) {
                             if (size || !topic.contains(number)) return;
                             size = take_start(message).size;
                             if (bag.connections().at(number).kind != MessageKind::kEventPacket) {
                               return;
                             }
                             try {
                               take_packet_start(message);
                             } catch (const EventFault& fault) {
                               refused = fault.what();
                             }
                           });
    } catch (const InputError&) {
      if (!damage) damage = std::current_exception();
      continue;
    }
    if (!refused.empty()) bag.at(byte, [&] { throw EventFault(refused); });
    if (size) return size->width > 0 && size->height > 0 ? size : std::nullopt;
  }
  if (damage) std::rethrow_exception(damage);
  return std::nullopt;
}

// ---- Frames

struct FramePlace {
  std::int64_t chunk = 0;
  std::uint64_t offset = 0;
  std::uint64_t size_bytes = 0;
};

/// A message with an image; without `pixels` all else of it.
PlacedFrame frame_of(std::string_view message, ImageSize size, bool pixels) {
  const MessageStart start = take_start(message);
  const std::string_view encoding = take_text(message);
  const bool is_grey = encoding == "mono8", is_rgb = encoding == "rgb8";
  if (start.size != size || (!is_grey && !is_rgb && encoding != "bgr8")) {
    throw EventFault(fmt::format("expected a frame of {} in mono8, bgr8 or rgb8, got {} in {}",
                                 to_string(size), to_string(start.size), encoding));
  }
  take<std::uint8_t>(message);  // the order of bytes
  const std::size_t row_bytes = take<std::uint32_t>(message), channels = is_grey ? 1 : 3;
  const std::string_view data = take_text(message);
  const auto width = static_cast<std::size_t>(size.width);
  if (row_bytes < channels * width ||
      data.size() != row_bytes * static_cast<std::size_t>(size.height)) {
    throw EventFault(fmt::format("expected {} rows of {} bytes, got {} bytes of rows of {}",
                                 size.height, channels * width, data.size(), row_bytes));
  }
  PlacedFrame frame{whole_us(start.stamp_ns), !is_grey};
  if (!pixels) return frame;
  ColourFrame colour{size, std::vector<std::uint8_t>(3 * size.pixel_count())};
  for (std::size_t i = 0; i < colour.bgr.size(); ++i) {
    const std::size_t channel = is_grey ? 0 : is_rgb ? 2 - i % 3 : i % 3;
    const std::size_t pixel = i / 3;
    colour.bgr[i] = static_cast<std::uint8_t>(
        data[pixel / width * row_bytes + pixel % width * channels + channel]);
  }
  frame.image = grey_of(colour, frame.is_colour);
  return frame;
}

using BagFrames = PlacedFrames<FramePlace>;

std::unique_ptr<BagFrames> frames_in(const std::shared_ptr<const RosbagFile>& bag, ImageSize size) {
  using Chunks = RecentlyUsed<std::int64_t, std::shared_ptr<const std::string>>;
  constexpr std::int64_t kMostKeptBytes = 1 << 24;
  const auto chunks = std::make_shared<Chunks>(
      kMostKeptBytes, [](const auto& content) { return std::ssize(*content); });
  return std::make_unique<BagFrames>(bag->name(), [bag, size, chunks](const FramePlace& place) {
    const auto content = chunks->get(
        place.chunk, [&] { return std::make_shared<const std::string>(bag->chunk(place.chunk)); });
    return bag->at(place.chunk, [&] {
      const std::string_view behind =
          std::string_view(*content).substr(std::min<std::size_t>(place.offset, content->size()));
      return frame_of(behind.substr(0, place.size_bytes), size, /*pixels=*/true);
    });
  });
}

/// The topics that may have frames of the camera whose events a topic has: that of raw images
/// first.
std::vector<std::string> frame_topics(const RosbagFile& bag, const std::string& events) {
  std::vector<std::string> topics;
  for (const auto& [topic, connections] : topics_of(bag, MessageKind::kImage)) {
    if (topic.starts_with(namespace_of(events))) topics.push_back(topic);
  }
  std::stable_partition(topics.begin(), topics.end(),
                        [](const std::string& topic) { return topic.ends_with("/image_raw"); });
  return topics;
}

/// Those whose images are not taken, which a user should know.
std::set<std::string> other_image_topics(const RosbagFile& bag, const std::string& taken) {
  std::set<std::string> others;
  for (const auto& [number, connection] : bag.connections()) {
    const bool is_image =
        connection.kind == MessageKind::kImage || connection.type == "sensor_msgs/CompressedImage";
    if (is_image && connection.topic != taken) others.insert(connection.topic);
  }
  return others;
}

/// What one look at the whole bag finds.
struct BagContents {
  std::unique_ptr<BagEvents> events;
  std::vector<std::pair<std::string, std::unique_ptr<BagFrames>>> frames;  ///< by their topics
  std::int64_t lost_chunks = 0;
  std::string reason;  ///< of the first

  std::string to_bytes() const {
    std::string bytes;
    for (const auto& [topic, found] : frames) found->pack_frames(bytes);
    events->pack_events(bytes);
    return bytes;
  }
  bool restore(std::string_view bytes) {
    for (const auto& [topic, found] : frames) {
      if (!found->unpack_frames(bytes)) return false;
    }
    return events->unpack_events(bytes);
  }
};

BagContents empty_contents(const std::shared_ptr<const RosbagFile>& bag, const std::string& topic,
                           ImageSize size) {
  BagContents contents{std::make_unique<BagEvents>(bag, topic, size), {}, 0, {}};
  for (const std::string& images : frame_topics(*bag, topic)) {
    contents.frames.emplace_back(images, frames_in(bag, size));
  }
  return contents;
}

BagContents read_contents(const std::shared_ptr<const RosbagFile>& bag, const std::string& topic,
                          const std::set<std::uint32_t>& event_connections, ImageSize size) {
  BagContents contents = empty_contents(bag, topic, size);
  const std::vector<std::int64_t> with_events = bag->chunks_of(event_connections);
  std::set<std::uint32_t> all = event_connections;
  const Topics image_topics = topics_of(*bag, MessageKind::kImage);
  std::map<std::uint32_t, BagFrames*> frames;
  for (const auto& [images, found] : contents.frames) {
    for (const std::uint32_t number : image_topics.at(images)) {
      frames.emplace(number, found.get());
      all.insert(number);
    }
  }
  for (const std::int64_t byte : bag->chunks_of(all)) {
    try {
      const std::string content = bag->chunk(byte);
      contents.events->add(byte, content);
      bag->for_each_message(
          byte, content, [&](std::uint32_t number, std::string_view message, std::size_t offset) {
            const auto found = frames.find(number);
            if (found == frames.end()) return;
            found->second->add({byte, offset, message.size()}, [&] {
              return bag->at(byte, [&] { return frame_of(message, size, /*pixels=*/false); });
            });
          });
    } catch (const InputError& error) {
      if (contents.lost_chunks++ == 0) contents.reason = error.what();
      if (std::ranges::binary_search(with_events, byte)) {
        contents.events->lose(std::current_exception());
      }
    }
  }
  return contents;
}

/// As read_contents, or as it was found before.
BagContents known_contents(const std::shared_ptr<const RosbagFile>& bag, const std::string& topic,
                           const std::set<std::uint32_t>& event_connections, ImageSize size,
                           std::string key) {
  EventIndexes* const indexes = key.empty() ? nullptr : EventIndexes::current();
  if (indexes == nullptr) return read_contents(bag, topic, event_connections, size);
  key += fmt::format(" {} {}", to_string(size), topic);
  if (const auto bytes = indexes->find(key)) {
    BagContents contents = empty_contents(bag, topic, size);
    if (contents.restore(*bytes)) return contents;
  }
  BagContents contents = read_contents(bag, topic, event_connections, size);
  if (contents.lost_chunks == 0) indexes->keep(key, contents.to_bytes());
  return contents;
}

}  // namespace

StoredParts open_rosbag(const std::filesystem::path& path, const RecordingOptions& options) {
  std::string index_key = event_index_key(path, "events");
  StoredParts parts{path.string(), {}, nullptr};
  const auto bag = std::make_shared<const RosbagFile>(path, parts.notes);
  const std::string topic = choose_topic(*bag, options);
  std::set<std::uint32_t> connections;
  for (const auto& [number, connection] : bag->connections()) {
    const bool is_event = connection.kind && connection.kind != MessageKind::kImage;
    if (is_event && connection.topic == topic) connections.insert(number);
  }
  parts.size = sensor_size(size_in_topic(*bag, connections), options.sensor, parts);
  BagContents contents = known_contents(bag, topic, connections, parts.size, std::move(index_key));

  const auto note = [&](std::int64_t number, std::string_view what) {
    if (number > 0) parts.notes.push_back(fmt::format("{}: {}, in {}", what, number, parts.name));
  };
  note(contents.events->outside(), "events beside the sensor are left out");
  note(contents.events->without_place(), "events before the first time and place are left out");
  if (contents.lost_chunks > 0) {
    parts.notes.push_back(
        fmt::format("chunks that are cut off or damaged are left out: {} (the first: {})",
                    contents.lost_chunks, contents.reason));
  }
  std::string taken;
  for (auto& [images, found] : contents.frames) {
    if (found->times_s().empty()) {
      std::ranges::move(found->notes(), std::back_inserter(parts.notes));
    } else if (!parts.frames) {
      parts.frames = std::move(found);
      taken = images;
    }
  }
  if (const auto others = other_image_topics(*bag, taken); !others.empty()) {
    parts.notes.push_back(
        fmt::format("images of other topics than the camera's {} are left out: "
                    "{}, in {}",
                    topic, fmt::join(others, ", "), parts.name));
  }
  parts.events = std::move(contents.events);
  return parts;
}

constinit const RecordingReader kRosbagReader{
    .format = RecordingFormat::kRosbag,
    .fits = [](const RecordingInput& input,
               const RecordingOptions&) { return input.beginning().starts_with(kRosbagFirstLine); },
    .open =
        [](const std::filesystem::path& path, const RecordingOptions& options) {
          return make_stored_recording(open_rosbag(path, options));
        }};

}  // namespace eventgan
