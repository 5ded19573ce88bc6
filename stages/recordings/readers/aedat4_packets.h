#pragma once

#include <cstdint>
#include <string_view>

namespace eventgan {

inline constexpr std::string_view kAedat4FirstLine = "#!AER-DAT4.0\r\n";

/// A packet as it lies in a file, or as the file's table of packets tells of it.
struct PacketPlace {
  std::int64_t byte = 0;  ///< where its content begins
  std::int64_t size_bytes = 0;
  int stream = 0;
  std::int64_t count = -1;  ///< of events or frames; -1: it is of neither
  // Of events, if there are any:
  std::int64_t begin_us = 0;
  std::int64_t end_us = 0;

  std::int64_t end() const { return byte + size_bytes; }
  double begin_s() const { return static_cast<double>(begin_us) / 1e6; }
  double end_s() const { return static_cast<double>(end_us) / 1e6; }
  /// Whether it can have so many events of such times.
  bool may_have_events() const;
};

}  // namespace eventgan
