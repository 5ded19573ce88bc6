#include "stages/recordings/writers/aedat4_writer.h"

#include <aedat4_generated.h>
#include <lz4frame.h>
#include <opencv2/core/hal/interface.h>

#include <algorithm>
#include <cstring>
#include <pugixml.hpp>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "stages/recordings/readers/aedat4_packets.h"
#include "stages/recordings/writers/detail/require.h"

namespace eventgan {
namespace {

constexpr std::size_t kEventsPerPacket = 8192;
constexpr char kSettingsKey[] = "simulation";
enum Stream : int { kEventStream, kFrameStream };
enum Compression : int { kLz4 = 1 };

std::string_view bytes_of(const flatbuffers::FlatBufferBuilder& builder) {
  return {reinterpret_cast<const char*>(builder.GetBufferPointer()), builder.GetSize()};
}

std::string packed(std::string_view bytes) {
  LZ4F_preferences_t preferences{};
  preferences.frameInfo.blockMode = LZ4F_blockIndependent;  // Java's readers know no other
  std::string frame(LZ4F_compressFrameBound(bytes.size(), &preferences), '\0');
  const std::size_t size =
      LZ4F_compressFrame(frame.data(), frame.size(), bytes.data(), bytes.size(), &preferences);
  if (LZ4F_isError(size)) throw std::logic_error(LZ4F_getErrorName(size));
  frame.resize(size);
  return frame;
}

pugi::xml_node add_node(pugi::xml_node parent, const std::string& name) {
  pugi::xml_node node = parent.append_child("node");
  const std::string above = parent.attribute("path").as_string("/mainloop/Recorder/");
  node.append_attribute("name") = name.c_str();
  node.append_attribute("path") = (above + name + "/").c_str();
  return node;
}

void add_attribute(pugi::xml_node node, const char* key, const char* type,
                   const std::string& value) {
  pugi::xml_node attribute = node.append_child("attr");
  attribute.append_attribute("key") = key;
  attribute.append_attribute("type") = type;
  attribute.text() = value.c_str();
}

std::string streams_xml(ImageSize size, const std::string& settings) {
  pugi::xml_document document;
  pugi::xml_node root = document.append_child("dv");
  root.append_attribute("version") = "2.0";
  const pugi::xml_node streams = add_node(root, "outInfo");
  const auto add = [&](Stream number, const char* output, const char* what, const char* type) {
    const pugi::xml_node stream = add_node(streams, std::to_string(number));
    add_attribute(stream, "compression", "string", "LZ4");
    add_attribute(stream, "originalModuleName", "string", "eventgan");
    add_attribute(stream, "originalOutputName", "string", output);
    add_attribute(stream, "typeDescription", "string", what);
    add_attribute(stream, "typeIdentifier", "string", type);
    const pugi::xml_node info = add_node(stream, "info");
    add_attribute(info, "sizeX", "int", std::to_string(size.width));
    add_attribute(info, "sizeY", "int", std::to_string(size.height));
    add_attribute(info, "source", "string", "eventgan");
    if (number == kEventStream && !settings.empty()) {
      add_attribute(info, kSettingsKey, "string", settings);
    }
  };
  add(kEventStream, "events", "Array of events (polarity ON/OFF).", "EVTS");
  add(kFrameStream, "frames", "Standard frame (8-bit image).", "FRME");
  std::ostringstream text;
  document.save(text, "", pugi::format_raw | pugi::format_no_declaration);
  return text.str();
}

}  // namespace

struct Aedat4Writer::File {
  AtomicFile output;
  ImageSize size;
  std::string xml;
  std::int64_t end_byte = 0;
  std::vector<aedat4::Event> events;  ///< of the packet to come
  std::int64_t last_us = 0;
  std::int64_t last_frame_us = -1;
  std::vector<PacketPlace> packets;

  File(const std::filesystem::path& file, ImageSize of, const std::string& settings)
      : output(file), size(of), xml(streams_xml(of, settings)) {}

  void write(std::string_view bytes) {
    output.write(bytes);
    end_byte += std::ssize(bytes);
  }

  /// As long whatever the table's place is.
  std::string header(std::int64_t table_byte) const {
    flatbuffers::FlatBufferBuilder builder;
    builder.ForceDefaults(true);
    const auto info = builder.CreateString(xml);
    builder.FinishSizePrefixed(aedat4::CreateHeader(builder, kLz4, table_byte, info), "IOHE");
    return std::string(kAedat4FirstLine) + std::string(bytes_of(builder));
  }

  void write_packet(Stream stream, const flatbuffers::FlatBufferBuilder& builder,
                    std::int64_t count, std::int64_t begin_us, std::int64_t end_us) {
    const std::string content = packed(bytes_of(builder));
    const aedat4::Packet packet(stream, static_cast<std::int32_t>(content.size()));
    write({reinterpret_cast<const char*>(&packet), sizeof(packet)});
    packets.push_back({end_byte, std::ssize(content), stream, count, begin_us, end_us});
    write(content);
  }

  void write_events() {
    if (events.empty()) return;
    flatbuffers::FlatBufferBuilder builder;
    const auto elements = builder.CreateVectorOfStructs(events);
    builder.FinishSizePrefixed(aedat4::CreateEvents(builder, elements), "EVTS");
    write_packet(kEventStream, builder, std::ssize(events), events.front().t_us(),
                 events.back().t_us());
    events.clear();
  }

  void write_table() {
    flatbuffers::FlatBufferBuilder builder;
    std::vector<flatbuffers::Offset<aedat4::PacketEntry>> entries;
    for (const PacketPlace& place : packets) {
      const aedat4::Packet packet(place.stream, static_cast<std::int32_t>(place.size_bytes));
      entries.push_back(aedat4::CreatePacketEntry(builder, place.byte, &packet, place.count,
                                                  place.begin_us, place.end_us));
    }
    builder.FinishSizePrefixed(aedat4::CreatePacketTable(builder, builder.CreateVector(entries)),
                               "FTAB");
    write(packed(bytes_of(builder)));
  }
};

Aedat4Writer::Aedat4Writer(const std::filesystem::path& file, ImageSize size,
                           const std::string& settings) {
  require(size.height > 0 && size.width > 0 && size.height <= kLargestSide &&
              size.width <= kLargestSide,
          "expected a sensor of 1 to 32767 pixels a side for AEDAT 4.0");
  file_ = std::make_unique<File>(file, size, settings);
  file_->output.create();
  file_->write(file_->header(-1));
}

Aedat4Writer::~Aedat4Writer() = default;

void Aedat4Writer::add_events(std::span<const StampedEvent> events) {
  require_recordable(events, file_->size, file_->last_us);
  for (const StampedEvent& event : events) {
    file_->events.emplace_back(event.t_us, static_cast<std::int16_t>(event.x),
                               static_cast<std::int16_t>(event.y), event.positive ? 1 : 0);
    if (file_->events.size() == kEventsPerPacket) file_->write_events();
  }
  if (!events.empty()) file_->last_us = events.back().t_us;
}

void Aedat4Writer::add_frame(std::int64_t t_us, std::span<const std::uint8_t> pixels) {
  const std::size_t count = file_->size.pixel_count();
  require(pixels.size() == count || pixels.size() == 3 * count,
          "expected a frame of one or three channels of the recording's size");
  require(t_us >= file_->last_us && t_us > file_->last_frame_us,
          "expected a frame after the one before and not before any event");
  file_->write_events();
  flatbuffers::FlatBufferBuilder builder;
  const auto values = builder.CreateVector(pixels.data(), pixels.size());
  const int type = pixels.size() == count ? CV_8UC1 : CV_8UC3;
  builder.FinishSizePrefixed(
      aedat4::CreateFrame(builder, t_us, 0, 0, 0, 0, static_cast<std::int8_t>(type),
                          static_cast<std::int16_t>(file_->size.width),
                          static_cast<std::int16_t>(file_->size.height), 0, 0, values),
      "FRME");
  file_->write_packet(kFrameStream, builder, 1, t_us, t_us);
  file_->last_us = file_->last_frame_us = t_us;
}

std::optional<std::string> aedat4_settings(const std::filesystem::path& path) {
  const InputFile file(path);
  std::uint32_t size = 0;
  const std::uint64_t line = kAedat4FirstLine.size();
  const std::string start = file.read(0, std::min(file.size_bytes(), line + sizeof(size)));
  if (!start.starts_with(kAedat4FirstLine) || start.size() < line + sizeof(size)) return {};
  std::memcpy(&size, start.data() + line, sizeof(size));
  if (size > file.size_bytes() - start.size()) return {};
  const std::string header = file.read(line, sizeof(size) + size);
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(header.data()),
                                 header.size());
  if (!verifier.VerifySizePrefixedBuffer<aedat4::Header>("IOHE")) return {};
  const auto* const xml = flatbuffers::GetSizePrefixedRoot<aedat4::Header>(header.data())->info();
  pugi::xml_document document;
  if (xml == nullptr || !document.load_buffer(xml->data(), xml->size())) return {};
  const pugi::xml_node found = document.find_node([](const pugi::xml_node& node) {
    return std::string_view(node.attribute("key").value()) == kSettingsKey;
  });
  if (!found) return {};
  return found.text().as_string();
}

void Aedat4Writer::commit(const std::function<void()>& before_publishing) {
  file_->write_events();
  const std::int64_t table_byte = file_->end_byte;
  file_->write_table();
  file_->output.overwrite(0, file_->header(table_byte));
  file_->output.sync();
  if (before_publishing) before_publishing();
  file_->output.publish();
}

}  // namespace eventgan
