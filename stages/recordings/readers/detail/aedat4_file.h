#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/aedat4_packets.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "stages/recordings/readers/detail/open_files.h"
#include "stages/recordings/readers/detail/placed_frames.h"

namespace eventgan {

/// Throws EventFault unless the table tells of a packet as it is; older writers left out all but
/// its place.
void check_packet(const PacketPlace& is, const PacketPlace& told);

/// A file in AEDAT 4.0 (docs.inivation.com): its header, where its packets are, and what is in
/// them. Thread safe. All throw InputError "expected X, got Y, in PATH (byte 4567)".
class Aedat4File {
 public:
  struct Stream {
    std::string type;  ///< "EVTS", "FRME", ...
    ImageSize size;
  };
  struct Header {
    std::int64_t end_byte = 0;     ///< where the packets begin
    std::int64_t table_byte = -1;  ///< -1: there is no table
    int compression = 0;
    std::map<int, Stream> streams;
  };

  /// Reads the header.
  explicit Aedat4File(const std::filesystem::path& path);

  const std::string& name() const { return file_.name(); }
  const Header& header() const { return header_; }

  /// The packets that the file's table tells of, in the file's order; none if it has no table.
  std::vector<PacketPlace> read_table() const;

  /// Where the packets are, in the file's order. Those of the table follow each other as it says,
  /// which is looked at when they are read. A last one that is cut off where there is no table is
  /// noted.
  std::vector<PacketPlace> find_packets(const std::vector<PacketPlace>& table,
                                        std::vector<std::string>& notes) const;

  /// Throws InputError unless the table tells of these packets as they are: of all their places,
  /// and of the first with events what is in it.
  void check_table(const std::vector<PacketPlace>& packets, const std::vector<PacketPlace>& table,
                   int event_stream) const;

  /// Reads a packet. What was not known of it is known then; what was must be so. Times may fall
  /// but in one whose times were known: of those between nobody has been told.
  CompactEvents events(PacketPlace& packet) const;

  /// The frame of a packet, which must be of this size; its time is the middle of its exposure.
  PlacedFrame frame(const PacketPlace& packet, ImageSize size) const;

  /// As RecordingFile::at.
  template <class Read>
  auto at(std::int64_t byte, Read read) const {
    return file_.at(byte, read);
  }
  [[noreturn]] void refuse(const std::string& fault, std::int64_t byte) const;

 private:
  std::string read(std::int64_t begin, std::int64_t end) const;
  std::string unpack(std::string bytes) const;
  std::string content(const PacketPlace& packet) const;

  RecordingFile file_;
  Header header_;
};

}  // namespace eventgan
