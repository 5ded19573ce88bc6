#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "stages/recordings/recording.h"

namespace eventgan {

/// Where a recording's datasets lie in an HDF5 file.
struct Hdf5Layout {
  std::string events;       ///< [events, 4]: x, y, t, p in the order of `columns`
  std::string frames;       ///< [frames, height, width] uint8
  std::string frame_times;  ///< [frames], as the events' times
  std::string
      event_index;   ///< [frames] integers near the last event before the frame; may be absent
  std::string flow;  ///< [frames - 1, 2, height, width] float; may be absent
  std::array<std::size_t, 4> columns = {0, 1, 2, 3};  ///< where events has x, y, t and p
  double ticks_per_s = 1;  ///< of times; 1: all numbers are float, else whole
  bool may_lack_frames = false;
};

/// MVSEC's, of one camera: "left" or "right".
Hdf5Layout mvsec_layout(const std::string& camera);

/// The EventGAN authors', which has no flow.
Hdf5Layout eventgan_layout();

/// v2e's (--dvs_h5): t in µs, x, y and p of 0 or 1; frames only where it was told to keep them.
Hdf5Layout v2e_layout();

/// A recording in an HDF5 file, of which events are read by ranges. `sensor` is what the options
/// give: a file without frames tells no size, and frames of another size are left out. Throws
/// InputError.
std::unique_ptr<Recording> open_hdf5_recording(
    const std::filesystem::path& path, const Hdf5Layout& layout,
    const std::optional<ImageSize>& sensor = std::nullopt);

}  // namespace eventgan
