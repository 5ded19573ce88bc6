#include "stages/recordings/readers/detail/rosbag_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "manifests/values/text.h"
#include "stages/recordings/readers/detail/unpacking.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMostChunkBytes = std::int64_t{1} << 30;

// ---- Records: a header of fields, and data

enum class Op : std::uint8_t {
  kMessage = 2,
  kBag = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7
};

/// "name=value" each, behind its length.
class Fields {
 public:
  explicit Fields(std::string_view header) {
    while (!header.empty()) {
      const std::string_view field = take_text(header);
      const std::size_t is = field.find('=');
      if (is == std::string_view::npos) throw EventFault("expected fields as name=value, got none");
      fields_.emplace_back(field.substr(0, is), field.substr(is + 1));
    }
  }

  std::string_view text(std::string_view name) const {
    for (const auto& [key, value] : fields_) {
      if (key == name) return value;
    }
    throw EventFault(fmt::format("expected a field \"{}\" in a record, got none", name));
  }

  template <class Number>
  Number number(std::string_view name) const {
    std::string_view value = text(name);
    return take<Number>(value);
  }

  Op op() const { return static_cast<Op>(number<std::uint8_t>("op")); }

 private:
  std::vector<std::pair<std::string_view, std::string_view>> fields_;
};

// ---- Connections

/// What a message consists of, as `fields_of` its definition, whatever its package is called.
struct MessageLayout {
  MessageKind kind;
  std::string_view type;  ///< of messages without a definition
  std::string_view layout;
};
constexpr std::array kLayouts{
    MessageLayout{MessageKind::kEventArray, "dvs_msgs/EventArray",
                  "Header header,uint32 height,uint32 width,Event[] events,"
                  "MSG: Event,uint16 x,uint16 y,time ts,bool polarity,"},
    MessageLayout{MessageKind::kEventPacket, "event_camera_msgs/EventPacket",
                  "Header header,uint32 height,uint32 width,uint64 seq,uint64 time_base,"
                  "string encoding,bool is_bigendian,uint8[] events,"},
    MessageLayout{MessageKind::kImage, "sensor_msgs/Image",
                  "Header header,uint32 height,uint32 width,string encoding,uint8 is_bigendian,"
                  "uint32 step,uint8[] data,"}};

/// A definition without comments, packages and what a Header is.
std::string fields_of(std::string_view definition) {
  std::string layout;
  bool is_header = false;
  while (!definition.empty()) {
    std::string_view line = definition.substr(0, definition.find('\n'));
    definition.remove_prefix(std::min(line.size() + 1, definition.size()));
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty() || line.starts_with("=====")) continue;
    const std::size_t gap = line.find_first_of(" \t");
    std::string_view type = line.substr(0, gap);
    std::string_view name = gap == line.npos ? std::string_view() : trimmed(line.substr(gap));
    for (std::string_view* const word : {&type, &name}) {
      word->remove_prefix(word->find('/') == word->npos ? 0 : word->find('/') + 1);
    }
    if (type == "MSG:") is_header = name == "Header";
    if (!is_header) layout += fmt::format("{} {},", type, name);
  }
  return layout;
}

RosbagConnection connection_of(std::string_view topic, std::string_view data) {
  const Fields fields(data);
  RosbagConnection connection{std::string(topic), std::string(fields.text("type")), std::nullopt};
  const std::string_view definition = trimmed(fields.text("message_definition"));
  const std::string layout = fields_of(definition);
  for (const MessageLayout& row : kLayouts) {
    if (definition.empty() ? row.type == connection.type : row.layout == layout) {
      connection.kind = row.kind;
    }
  }
  return connection;
}

}  // namespace

RosbagFile::RosbagFile(const std::filesystem::path& path, std::vector<std::string>& notes)
    : file_(path) {
  at(0, [&] {
    const std::string line =
        file_.read_between(0, std::min(std::ssize(kRosbagFirstLine), file_.end_byte()));
    if (line != kRosbagFirstLine) throw EventFault("expected \"#ROSBAG V2.0\", got another file");
  });
  try {
    read_index();
  } catch (const InputError& error) {
    chunks_.clear();
    connections_.clear();
    notes.push_back(fmt::format(
        "the bag has no index that can be used, as after an interruption: what is there is read "
        "(index: {})",
        error.what()));
    find_chunks(notes);
  }
}

std::vector<std::int64_t> RosbagFile::chunks_of(const std::set<std::uint32_t>& connections) const {
  std::vector<std::int64_t> places;
  for (const auto& [byte, told] : chunks_) {
    const auto is_one = [&](std::uint32_t number) { return connections.contains(number); };
    if (!told || std::ranges::any_of(*told, is_one)) places.push_back(byte);
  }
  return places;
}

std::string RosbagFile::chunk(std::int64_t byte) const {
  return at(byte, [&] {
    const Record record = record_at(byte);
    const Fields fields(record.header);
    if (fields.op() != Op::kChunk) throw EventFault("expected a chunk, got another record");
    const std::string_view compression = fields.text("compression");
    const std::int64_t size = fields.number<std::uint32_t>("size");
    if (record.end > file_.end_byte()) {
      throw EventFault(fmt::format("expected a chunk up to byte {}, got a file of {} bytes",
                                   record.end, file_.end_byte()));
    }
    if (std::max(size, record.end - record.data) > kMostChunkBytes) {
      throw EventFault(fmt::format("expected a chunk of at most {} bytes, got {}", kMostChunkBytes,
                                   std::max(size, record.end - record.data)));
    }
    std::string content = file_.read_between(record.data, record.end);
    const auto most = static_cast<std::size_t>(size);
    if (compression == "bz2") {
      content = unpack_bz2(content, most);
    } else if (compression == "lz4") {
      content = unpack_lz4(content, most);
    } else if (compression != "none") {
      throw EventFault(fmt::format("expected a chunk in none, bz2 or lz4, got {}", compression));
    }
    if (std::ssize(content) == size) return content;
    throw EventFault(fmt::format("expected a chunk of {} bytes, got {}", size, content.size()));
  });
}

void RosbagFile::for_each_message(std::int64_t byte, std::string_view content,
                                  const TakeMessage& take) const {
  at(byte, [&] {
    for (std::string_view rest = content; !rest.empty();) {
      const Fields fields(take_text(rest));
      const std::string_view data = take_text(rest);
      if (fields.op() == Op::kMessage) {
        take(fields.number<std::uint32_t>("conn"), data,
             static_cast<std::size_t>(data.data() - content.data()));
      } else if (fields.op() != Op::kConnection) {
        throw EventFault("expected messages in a chunk, got another record");
      }
    }
  });
}

RosbagFile::Record RosbagFile::record_at(std::int64_t byte) const {
  constexpr std::int64_t kUsualBytes = 512, kMostHeaderBytes = 1 << 20;
  const auto read = [&](std::int64_t count) {
    return file_.read_between(byte, std::min(byte + count, file_.end_byte()));
  };
  std::string bytes = read(kUsualBytes);
  std::string_view rest = bytes;
  const std::int64_t header_bytes = take<std::uint32_t>(rest);
  if (header_bytes > kMostHeaderBytes) {
    throw EventFault(fmt::format("expected a record, got a header of {} bytes", header_bytes));
  }
  if (std::ssize(rest) < header_bytes + 4) bytes = read(header_bytes + 8);
  rest = bytes;
  Record record{std::string(take_text(rest))};
  const std::int64_t data_bytes = take<std::uint32_t>(rest);
  record.data = byte + 4 + header_bytes + 4;
  record.end = record.data + data_bytes;
  return record;
}

std::string RosbagFile::data_of(const Record& record) const {
  constexpr std::int64_t kMostBytes = 1 << 24;  // of a definition, or of what a chunk has
  if (record.end > file_.end_byte() || record.end - record.data > kMostBytes) {
    throw EventFault(fmt::format("expected a record up to byte {} at most, got one up to {}",
                                 file_.end_byte(), record.end));
  }
  return file_.read_between(record.data, record.end);
}

void RosbagFile::read_index() {
  constexpr auto kHeaderAt = static_cast<std::int64_t>(kRosbagFirstLine.size());
  at(kHeaderAt, [&] {
    const Record bag = record_at(kHeaderAt);
    const Fields fields(bag.header);
    if (fields.op() != Op::kBag) throw EventFault("expected a bag's header, got another record");
    const auto index_at = fields.number<std::uint64_t>("index_pos");
    if (index_at < static_cast<std::uint64_t>(bag.end) ||
        index_at > static_cast<std::uint64_t>(file_.end_byte())) {
      throw EventFault(
          fmt::format("expected it at byte {} to {}, got {}", bag.end, file_.end_byte(), index_at));
    }
    for (auto byte = static_cast<std::int64_t>(index_at); byte < file_.end_byte();) {
      byte = read_index_record(byte);
    }
    const auto chunks = fields.number<std::uint32_t>("chunk_count");
    const auto connections = fields.number<std::uint32_t>("conn_count");
    if (chunks != chunks_.size() || connections != connections_.size()) {
      throw EventFault(fmt::format("expected {} chunks and {} connections, got {} and {}", chunks,
                                   connections, chunks_.size(), connections_.size()));
    }
  });
}

std::int64_t RosbagFile::read_index_record(std::int64_t byte) {
  const Record record = record_at(byte);
  const Fields fields(record.header);
  const std::string data = data_of(record);
  if (fields.op() == Op::kConnection) {
    add_connection(record.header, data);
  } else if (fields.op() == Op::kChunkInfo) {
    const auto place = static_cast<std::int64_t>(fields.number<std::uint64_t>("chunk_pos"));
    if (place < 0 || place >= byte) {
      throw EventFault(fmt::format("expected a chunk before byte {}, got {}", byte, place));
    }
    std::vector<std::uint32_t> told;
    for (std::string_view rest = data; !rest.empty();) {
      told.push_back(take<std::uint32_t>(rest));
      take<std::uint32_t>(rest);  // how many messages
    }
    chunks_.insert_or_assign(place, std::move(told));
  } else {
    throw EventFault("expected a connection or what a chunk has, got another record");
  }
  return record.end;
}

void RosbagFile::add_connection(std::string_view header, std::string_view data) {
  const Fields fields(header);
  connections_.insert_or_assign(fields.number<std::uint32_t>("conn"),
                                connection_of(fields.text("topic"), data));
}

void RosbagFile::find_chunks(std::vector<std::string>& notes) {
  for (std::int64_t byte = std::ssize(kRosbagFirstLine); byte < file_.end_byte();) {
    try {
      const Record record = record_at(byte);
      if (Fields(record.header).op() == Op::kChunk) {
        if (record.end == record.data) {  // its length is written when it is closed
          throw EventFault("expected a chunk that was closed, got another");
        }
        chunks_.emplace(byte, std::nullopt);
      }
      byte = record.end;
    } catch (const EventFault& fault) {
      notes.push_back(fmt::format("the last {} bytes are left out: {}, in {} (byte {})",
                                  file_.end_byte() - byte, fault.what(), name(), byte));
      break;
    }
  }
  for (const auto& [byte, told] : chunks_) {
    try {
      at(byte, [&, place = byte] {
        const std::string content = chunk(place);
        for (std::string_view rest = content; !rest.empty();) {
          const std::string_view header = take_text(rest);
          const std::string_view data = take_text(rest);
          if (Fields(header).op() == Op::kConnection) add_connection(header, data);
        }
      });
    } catch (const InputError&) {  // whoever reads its messages is told
    }
  }
}

}  // namespace eventgan
