#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "manifests/event.h"
#include "stages/recordings/event_check_internal.h"
#include "stages/recordings/random_access_file_internal.h"

namespace eventgan {

/// `events.txt` of an ECD recording: a line "t x y p" for each event, in time order. Only what is
/// asked for is read: a time is found by halving the file. Thread safe.
class EcdEventFile {
 public:
  /// Throws InputError if it is no readable file.
  explicit EcdEventFile(const std::filesystem::path& path) : file_(path) {}

  /// Where the first line begins whose time is after `time_s`; the end of the file if there is
  /// none. Throws InputError "expected X, got Y, in FILE (line 3)", the line counted from 1.
  std::int64_t first_byte_after(double time_s) const;

  /// The events of the lines in begin..end, both from `first_byte_after`. Throws likewise.
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

  RandomAccessFile file_;
};

}  // namespace eventgan
