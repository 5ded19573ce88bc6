#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/events.h"
#include "stages/base/files/input_file.h"
#include "stages/recordings/detail/event_check.h"

namespace eventgan {

/// Parses a line "t x y p" of an ECD `events.txt`: t in seconds, the others whole numbers,
/// between blanks or tabs; without its line end, but for a CR. Throws EventFault.
StoredEvent parse_ecd_event(std::string_view line);

/// Its time alone, which must be finite here, since it is searched by.
double parse_ecd_event_time(std::string_view line);

/// `events.txt` of an ECD recording: a line "t x y p" for each event, in time order. Only what is
/// asked for is read: a time is found by halving the file. Thread safe.
class EcdEventFile {
 public:
  /// Throws InputError if it is no readable file.
  explicit EcdEventFile(const std::filesystem::path& path) : file_(path) {}

  /// Where the first line begins whose time is after `time_s`; the end of the file if there is
  /// none. Throws InputError "expected X, got Y, in FILE (line 3)", the line counted from 1.
  std::int64_t first_byte_after(double time_s) const;

  /// Where the line begins that is `lines` lines before (negative) or after the one that begins at
  /// `byte`; the file's start or end if there are fewer.
  std::int64_t skip_lines(std::int64_t byte, std::int64_t lines) const;

  /// Times of the first and last line; none of an empty file.
  std::optional<std::array<double, 2>> span() const;

  /// The events of the lines in begin..end, both line starts. Throws likewise.
  std::vector<Event> events(std::int64_t begin, std::int64_t end, EventCheck check) const;

 private:
  struct Line {
    std::int64_t begin;
    std::int64_t end;  ///< behind its line end
    double time_s;
  };

  /// The first line that begins at or after `byte`, which is inside the file and not in its last
  /// line.
  Line line_from(std::int64_t byte) const;
  [[noreturn]] void refuse(const EventFault& fault, std::int64_t line_begin) const;

  InputFile file_;
};

}  // namespace eventgan
