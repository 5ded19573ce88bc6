#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "manifests/files/atomic_file.h"
#include "manifests/values/frames.h"
#include "stages/recordings/writers/event_columns_writer.h"

namespace eventgan {

/// Writes a Prophesee RAW file in EVT 3.0, as Metavision Studio, OpenEB, faery and expelliarmus
/// open it (docs.prophesee.ai, "EVT 3.0 Format"): a text header with the format and the size, then
/// words of 16 bits, little endian, whose upper four bits are their type:
///   8: bits 12..23 of the time in microseconds   6: its bits 0..11
///   0: the row y                                 2: the column x, and in bit 11 the polarity
/// A word is written where what it tells has changed. The upper bits of the time are told every
/// 4096 µs, whether there are events or not, since readers take a fall of them for 2^24 µs.
///
/// The file appears under its name on commit() only, whole (atomic_file.h). The same events give
/// the same bytes, however they are portioned. Members throw std::runtime_error naming the file on
/// I/O errors. Thread safety: one writer is for one thread.
class Evt3Writer {
 public:
  static constexpr int kLargestSide = 2048;

  /// `settings`: a line of text, kept in the header as `simulation`; none if empty.
  /// Throws std::invalid_argument for a size that is empty, or beyond 2048 pixels a side, which the
  /// words do not hold.
  Evt3Writer(const std::filesystem::path& file, ImageSize size, const std::string& settings = "");

  /// Events in time order over all calls, within the size, their times from 0 on. Throws
  /// std::invalid_argument if these rules are broken; then nothing was added.
  void add_events(std::span<const StampedEvent> events);

  /// Publishes the file of a recording that lasts until `end_us`, not before its last event: its
  /// last word is of that time. `before_publishing` as of MvsecWriter.
  void commit(std::int64_t end_us, const std::function<void()>& before_publishing = {});

 private:
  void put(unsigned type, std::int64_t value);
  void go_to(std::int64_t t_us);
  void write_if_full(std::size_t most);

  AtomicFile file_;
  ImageSize size_;
  std::string words_;  ///< not yet written
  std::int64_t last_us_ = 0;
  std::int64_t high_ = -1;
  std::optional<std::int64_t> low_, y_;
};

/// The settings that a writer was given for this file; none if it is no such file. Throws
/// InputError if it cannot be read. Thread safe.
std::optional<std::string> evt3_settings(const std::filesystem::path& file);

}  // namespace eventgan
