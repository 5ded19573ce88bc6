#pragma once

#include <fmt/core.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/detail/open_files.h"

namespace eventgan {

inline constexpr std::string_view kRosbagFirstLine = "#ROSBAG V2.0\n";

/// Each takes what is next off the front of `bytes`, or throws EventFault.
inline std::string_view take_bytes(std::string_view& bytes, std::size_t count) {
  if (bytes.size() < count) {
    throw EventFault(fmt::format("expected {} bytes, got {}", count, bytes.size()));
  }
  const std::string_view taken = bytes.substr(0, count);
  bytes.remove_prefix(count);
  return taken;
}

template <class Number>
Number take(std::string_view& bytes) {
  Number number;
  std::memcpy(&number, take_bytes(bytes, sizeof(number)).data(), sizeof(number));
  return number;
}

inline std::string_view take_text(std::string_view& bytes) {
  return take_bytes(bytes, take<std::uint32_t>(bytes));
}

/// Of those that are read.
enum class MessageKind { kEventArray, kEventPacket, kImage };

/// A topic of a node, and what its messages are.
struct RosbagConnection {
  std::string topic;
  std::string type;
  std::optional<MessageKind> kind;
};

/// A bag of ROS 1, format 2.0 (wiki.ros.org/Bags/Format/2.0): where its chunks are, and the
/// messages in them. Thread safe. All throw InputError "expected X, got Y, in PATH (byte 4567)".
class RosbagFile {
 public:
  /// Finds its chunks and connections: by its index, or where there is none that can be used, which
  /// is noted, one chunk behind the other.
  RosbagFile(const std::filesystem::path& path, std::vector<std::string>& notes);

  const std::string& name() const { return file_.name(); }
  const std::map<std::uint32_t, RosbagConnection>& connections() const { return connections_; }

  /// The chunks that may have messages of these connections, by where they lie.
  std::vector<std::int64_t> chunks_of(const std::set<std::uint32_t>& connections) const;

  /// What is in the chunk at a place, unpacked.
  std::string chunk(std::int64_t byte) const;

  /// Gets a message's connection and bytes, and where these begin in its chunk.
  using TakeMessage = std::function<void(std::uint32_t, std::string_view, std::size_t)>;
  /// Takes each message of a chunk; an EventFault of `take` is of the chunk.
  void for_each_message(std::int64_t byte, std::string_view content, const TakeMessage& take) const;

  /// As RecordingFile::at.
  template <class Read>
  auto at(std::int64_t byte, Read read) const {
    return file_.at(byte, read);
  }

 private:
  struct Record {
    std::string header;
    std::int64_t data = 0;  ///< where it begins
    std::int64_t end = 0;   ///< which may lie behind the file's
  };

  Record record_at(std::int64_t byte) const;
  std::string data_of(const Record& record) const;
  /// What lies behind the chunks: all connections, and what each chunk has.
  void read_index();
  /// Gives where the next one is.
  std::int64_t read_index_record(std::int64_t byte);
  void add_connection(std::string_view header, std::string_view data);
  /// All chunks, and the connections in them.
  void find_chunks(std::vector<std::string>& notes);

  RecordingFile file_;
  /// By their places; which connections have messages there, if it is told.
  std::map<std::int64_t, std::optional<std::vector<std::uint32_t>>> chunks_;
  std::map<std::uint32_t, RosbagConnection> connections_;
};

}  // namespace eventgan
