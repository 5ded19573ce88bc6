#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/recordings/detail/event_check.h"
#include "stages/recordings/detail/frame_intervals.h"
#include "stages/recordings/detail/hdf5_table.h"
#include "stages/recordings/recording.h"

namespace eventgan {

/// Where a recording's datasets lie in an HDF5 file.
struct Hdf5Layout {
  std::string events;       ///< [events, 4] float: x, y, t in seconds, p
  std::string frames;       ///< [frames, height, width] uint8
  std::string frame_times;  ///< [frames] float, seconds
  std::string
      event_index;   ///< [frames] integers near the last event before the frame; may be absent
  std::string flow;  ///< [frames - 1, 2, height, width] float; may be absent
};

/// MVSEC's, of one camera: "left" or "right".
Hdf5Layout mvsec_layout(const std::string& camera);

/// The EventGAN authors', which has no flow.
Hdf5Layout eventgan_layout();

/// The datasets of a recording, of which it is known that they fit together.
struct Hdf5RecordingTables {
  Hdf5Handle file;  ///< first, so that it closes last
  Hdf5Table events;
  Hdf5Table frames;
  std::optional<Hdf5Table> flow;
  ImageSize size;
  std::vector<double> frame_times_s;
  std::vector<std::int64_t> event_index;  ///< as the file says, or empty
};

/// A recording in an HDF5 file. Events are read by ranges; where a frame's events end is looked up
/// by time, the file's own event index being only a guess, since its meaning differs among files.
class Hdf5Recording final : public Recording {
 public:
  /// Throws InputError.
  Hdf5Recording(const std::filesystem::path& path, const Hdf5Layout& layout);

  const std::string& name() const override { return name_; }
  ImageSize size() const override { return tables_.size; }
  std::int64_t frame_count() const override {
    return static_cast<std::int64_t>(tables_.frame_times_s.size());
  }
  double frame_time_s(std::int64_t index) const override;
  GreyImage frame(std::int64_t index) const override;
  std::vector<Event> events_between(std::int64_t first_frame,
                                    std::int64_t last_frame) const override;
  std::vector<Event> events_in(double after_s, double until_s) const override;
  std::vector<Event> events_around(double time_s, std::int64_t before,
                                   std::int64_t after) const override;
  std::optional<std::array<double, 2>> event_span() const override;
  std::optional<FlowField> flow(std::int64_t index) const override;

 private:
  std::int64_t event_count() const { return static_cast<std::int64_t>(tables_.events.dims()[0]); }
  std::int64_t events_until(std::size_t frame) const;
  std::int64_t events_until_time(double time_s) const;
  std::vector<double> event_times(std::int64_t first, std::int64_t count) const;
  std::vector<Event> read_events(std::int64_t begin, std::int64_t end, EventCheck check) const;

  [[noreturn]] void refuse(const EventFault& fault, std::int64_t event) const;

  /// Runs `read` under the lock; "expected readable values, got damage" with WHAT if HDF5 fails.
  template <class Read>
  auto read_locked(const std::string& what, Read read) const;

  std::string name_;
  Hdf5RecordingTables tables_;
  EventBoundaries boundaries_;
};

}  // namespace eventgan
