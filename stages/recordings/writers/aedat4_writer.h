#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "manifests/values/frames.h"
#include "stages/recordings/writers/event_columns_writer.h"

namespace eventgan {

/// Writes a file in AEDAT 4.0, as DV's viewer and dv-processing read it (docs.inivation.com, "AEDAT
/// 4.0"): a line, a header with the streams in XML, packets, and a table of the packets. Stream 0
/// has the events (EVTS), in packets of at most 8192, stream 1 the frames (FRME), one a packet, in
/// the order of time. Packets and table are LZ4 frames, as DV's own.
///
/// The file appears under its name on commit() only, whole (atomic_file.h). The same calls give the
/// same bytes, however the events are portioned. Members throw std::runtime_error naming the file
/// on I/O errors. Thread safety: one writer is for one thread.
class Aedat4Writer {
 public:
  static constexpr int kLargestSide = 32767;

  /// `settings`: kept in the XML, as the attribute `simulation` of the events' node "info"; none
  /// if empty. Throws std::invalid_argument for a size that is empty, or beyond 32767 pixels a
  /// side, which the fields do not hold.
  Aedat4Writer(const std::filesystem::path& file, ImageSize size, const std::string& settings = "");
  ~Aedat4Writer();

  /// Events in time order over all calls and not before the last frame, within the size, their
  /// times from 0 on. Throws std::invalid_argument if these rules are broken; then nothing was
  /// added.
  void add_events(std::span<const StampedEvent> events);

  /// A frame of the whole size, not before any event, and after the frame before: pixels [y, x] or
  /// [y, x, channel] with channels blue, green, red. Its time is that of the frame, which has no
  /// exposure. Throws std::invalid_argument if these rules are broken; then nothing was added.
  void add_frame(std::int64_t t_us, std::span<const std::uint8_t> pixels);

  /// `before_publishing` as of MvsecWriter.
  void commit(const std::function<void()>& before_publishing = {});

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// The settings that a writer was given for this file; none if it is no such file. Throws
/// InputError if it cannot be read. Thread safe.
std::optional<std::string> aedat4_settings(const std::filesystem::path& file);

}  // namespace eventgan
