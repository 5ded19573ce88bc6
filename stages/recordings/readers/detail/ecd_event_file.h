#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/events.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/order/time_order.h"
#include "stages/recordings/readers/detail/open_files.h"

namespace eventgan {

/// Parses a line "t x y p" of an ECD `events.txt`: t in seconds, the others whole numbers,
/// between blanks or tabs; without its line end, but for a CR. Throws EventFault.
StoredEvent parse_ecd_event(std::string_view line);

/// `events.txt` of an ECD recording: a line "t x y p" for each event, in time order; lines before
/// the first that begin with # are passed over, as v2e writes some. All times are looked at when
/// the first is asked for; of the events only those asked for are read. Thread safe.
class EcdEventFile {
 public:
  /// Throws InputError if it is no readable file.
  explicit EcdEventFile(const std::filesystem::path& path);

  /// Where the first line begins whose time is after `time_s`, at which no time may fall; the end
  /// of the file if there is none. A line that is no event is passed over.
  std::int64_t first_byte_after(double time_s) const;

  /// Throws InputError "expected X, got Y, in FILE (line 3)", the line counted from 1, if events of
  /// times in (after_s, until_s] may lie elsewhere than among the others of theirs.
  void require_order(double after_s, double until_s) const;

  /// Where the line begins that is `lines` lines before (negative) or after the one that begins at
  /// `byte`; the file's start or end if there are fewer.
  std::int64_t skip_lines(std::int64_t byte, std::int64_t lines) const;

  /// The earliest and the latest time; none of a file without events. The first and the last line
  /// must be events. Throws likewise.
  std::optional<std::array<double, 2>> span() const;

  /// The time of the line that begins at `byte`. Throws likewise.
  double time_at(std::int64_t byte) const;

  /// The events of the lines in begin..end, both line starts. Throws likewise.
  std::vector<Event> events(std::int64_t begin, std::int64_t end, EventCheck check) const;

 private:
  const TimeOrder& order() const;
  TimeOrder look_at_times() const;
  [[noreturn]] void refuse(const EventFault& fault, std::int64_t line_begin) const;

  std::string index_key_;  ///< before it is opened: of no later file in its place
  RecordingFile file_;
  std::int64_t begin_ = 0;  ///< of the first line that is no comment
  mutable std::once_flag order_once_;
  mutable TimeOrder order_;  ///< by bytes
};

}  // namespace eventgan
