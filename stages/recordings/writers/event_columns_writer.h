#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "manifests/values/frames.h"

namespace eventgan {

/// An event with its time in whole microseconds.
struct StampedEvent {
  std::int64_t t_us = 0;
  std::uint16_t x = 0;
  std::uint16_t y = 0;
  bool positive = true;
};

/// Throws std::invalid_argument unless the events lie within the size and their times, from
/// `first_us` on, never fall.
void require_recordable(std::span<const StampedEvent> events, ImageSize size,
                        std::int64_t first_us);

/// Who keeps events as columns of one HDF5 file, events/{x, y, t, p}: x and y uint16, p uint8 (0 or
/// 1), t in microseconds.
enum class ColumnFile {
  /// DSEC's events.h5: t uint32, counted from `t_offset` (int64, a number by itself), and
  /// `ms_to_idx` uint64: entry m is the index of the first event with t >= 1000 m. DSEC's has no
  /// size, which are the file's attributes `height` and `width` here, int32.
  kDsec,
  /// Prophesee's as RVT reads them (*_td.h5): t int64, and the numbers `events/height` and
  /// `events/width`, int64.
  kProphesee
};

/// Writes such a file: chunked and deflated, with checksums; h5py reads it without any plugin. The
/// file appears under its name on commit() only, whole (atomic_file.h). The same events give the
/// same bytes, however they are portioned.
///
/// All members throw std::runtime_error naming the file on I/O errors. Thread safety: one writer is
/// for one thread.
class EventColumnsWriter {
 public:
  /// `offset_us`: kDsec's t_offset. Throws std::invalid_argument for a size that is empty or beyond
  /// uint16.
  EventColumnsWriter(const std::filesystem::path& file, ColumnFile layout, ImageSize size,
                     std::int64_t offset_us = 0);
  ~EventColumnsWriter();

  /// Events in time order over all calls, within the size, their times from 0 on (of kDsec: from
  /// `offset_us` on). Throws std::invalid_argument if these rules are broken, or for a time of
  /// kDsec beyond uint32; then nothing was added.
  void add_events(std::span<const StampedEvent> events);

  /// Publishes the file of a recording that ends at `end_us`, not before its last event: that far,
  /// rounded up to the next millisecond, goes kDsec's `ms_to_idx`, whose entries behind the last
  /// event are the number of events. Throws std::invalid_argument for an earlier end, and of kDsec
  /// for one beyond uint32.
  void commit(std::int64_t end_us);

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// Writes DSEC's rectify_map.h5 of a camera without distortion: `rectify_map`, float32 [H, W, 2],
/// where each pixel's place (x, y) is itself. Whole, as above. Throws std::runtime_error.
void write_rectify_map(const std::filesystem::path& file, ImageSize size);

}  // namespace eventgan
